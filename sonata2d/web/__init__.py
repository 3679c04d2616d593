"""The browser client of studies: a server, and the page of a participant."""
