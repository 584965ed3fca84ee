"""A link on patches of its camera: the plan, its check, and the ladder of tolerances."""
