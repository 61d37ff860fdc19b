"""A robot to build from a body that grew: scale, servos, printed parts, and its simulation."""
