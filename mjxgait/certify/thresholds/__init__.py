"""What is demanded where a task is not to walk, one file for a family of tasks."""
