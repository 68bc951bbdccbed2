"""What a depth camera shows of a part, and what a network makes of it: grasp, joint and size, without being told."""
