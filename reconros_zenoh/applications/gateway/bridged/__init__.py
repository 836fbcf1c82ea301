"""The project with a gateway: subscribers in hardware read a stream."""
