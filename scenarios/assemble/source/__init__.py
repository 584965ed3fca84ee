"""What makes a stream: a camera, an imager, a recording, a link that carries a file."""
