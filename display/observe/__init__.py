"""Who looks at a display: eyes, cameras, and the stages that gather what they see."""
