"""Reset, observe, reward, success: Warp kernels, one graph launch a step."""
