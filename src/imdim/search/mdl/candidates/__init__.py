"""Primitives that a program of a noisy cloud may lack: at what it leaves unexplained, rims, shells and slots."""
