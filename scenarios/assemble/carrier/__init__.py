"""The way of a camera's stream to a display in another place: code, link, decoder."""
