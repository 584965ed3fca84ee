"""Effects of the asynchronous pixel: bounds, the plan, its check, and cost."""
