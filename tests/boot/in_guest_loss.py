"""In the guest: what a killed daemon left. in_guest_loss.py RECORDING MOMENT-OF-THE-KILL-IN-NS"""

import sys
from pathlib import Path

from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import TOPICS

path, killed = Path(sys.argv[1]), int(sys.argv[2])
recording = read(path, TOPICS)
times = [message[1] for message in recording.messages()]
lost = (killed - max(times)) * 1e-9
print(
    f"{path.name}: closed: {recording.closed}, {len(times)} messages readable, "
    f"the last {lost:.3f} s before the kill"
)
