"""gritd: learns the soil under a rover wheel while the wheel drives."""
