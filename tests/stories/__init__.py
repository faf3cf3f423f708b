"""The first hour of six kinds of users, as tests that anyone can run."""
