"""A line of text for every command, and the position twice a second without being asked."""
