"""The way of a stream to another place: code, link, decoder."""
