"""Perception: the network that follows a part in depth images, and the policy that acts on its estimates."""
