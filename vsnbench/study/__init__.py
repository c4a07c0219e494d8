"""Study plans: file, lock, schedule, codes and stopping rules."""
