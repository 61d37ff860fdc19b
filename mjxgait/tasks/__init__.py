"""What a creature is to do, what is counted of it, and what that is worth."""
