"""Controllers: from what a creature senses to what its joints are told."""
