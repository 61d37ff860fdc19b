"""Evolution: proposal of genomes and selection of survivors."""
