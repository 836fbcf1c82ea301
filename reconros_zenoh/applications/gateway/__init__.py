"""The synthetic setup of the gateways paper: a topic in software, and the same with a gateway."""
