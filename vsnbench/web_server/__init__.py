"""One Starlette server with authentication and limits; the pages are in `vsnbench.web`."""
