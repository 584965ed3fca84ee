"""What a display costs and what leaving its effects out changes."""
