"""One drive as its recording has it: people, departure check, modes, marks, interventions, alarms, distance."""
