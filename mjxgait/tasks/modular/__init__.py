"""Tasks for modular bodies: swim, roam, jump and follow."""
