"""What other computers may find. A surface that only this one reaches is nobody else's business: none is announced."""
