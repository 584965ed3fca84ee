"""What every page of a report is put together from."""
