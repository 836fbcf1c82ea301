"""The driving example of Mapping and Optimizing Communication, Section 6: a robot that follows a lane."""
