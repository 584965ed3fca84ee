"""A link set up from its scenario: the mode, by pilots unless it is given, and what is sent."""
