"""The kinds of scene, one file each: the section of the scenario and its source of light."""
