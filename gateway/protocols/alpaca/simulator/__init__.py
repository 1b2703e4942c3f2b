"""The simulated Alpaca telescope: a server that speaks Alpaca as real ones do, written without the gateway's tables."""
