"""From video to sound: what rendered structures radiate, as cameras have it and as it is."""
