"""Controllers of one expression per joint (Gritz & Hahn 1995, 1997): trees as arrays."""
