"""Where the stages meet: plan, keyframes, refinement, in-betweens, result."""
