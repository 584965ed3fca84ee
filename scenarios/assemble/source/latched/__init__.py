"""The latched camera and the display that its stream drives: setup, plan, check, evaluation."""
