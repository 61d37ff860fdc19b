"""Controllers: from a creature's observations to the commands of its joints."""
