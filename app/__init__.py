"""The application: it joins organ geometry and beam physics to a dissection one can run and see."""
