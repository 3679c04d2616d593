"""Robot controllers: the `Controller` interface and the stock controllers."""
