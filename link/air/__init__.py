"""What lies between panel and camera: geometry, lens, air, stray light."""
