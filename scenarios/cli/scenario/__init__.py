"""Commands on a scenario: run, plan, accuracy, live, list."""
