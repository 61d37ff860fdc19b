"""Controllers that are expressions, one per joint (Gritz & Hahn 1995, 1997): trees as arrays."""
