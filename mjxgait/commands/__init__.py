"""The code of the subcommands that are not part of training; each is imported when it is called."""
