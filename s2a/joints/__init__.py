"""What is found by gradient: joint dynamics, axes."""
