"""What bodies that grow are to do."""
