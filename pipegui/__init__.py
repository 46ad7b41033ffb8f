"""The desktop program: shows what pipecore finds, computes nothing of its own."""
