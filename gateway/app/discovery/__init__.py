"""What other computers may find: surfaces and pages that are not for this one alone, announced in two ways."""
