"""Every tuned number of the diagnosis, by what it decides, each with its reason.

They are found on blind trials of the simulated bench and on recordings that the project did not make, or
assumed, as each says. Ranges of the unknowns stand in ``equations/parameters.py``, the runs that can be
proposed in ``experiment/predicted_runs.py``. A squared score is a misfit per independent value, in units of
the floor; log odds are natural. ``docs/stated.py`` makes the page of numbers from this file.
"""

from __future__ import annotations

import numpy as np

# ## The scales of a machine, in which all other numbers here are told

USUAL_PACE = 7.0
"""Speed over travel of the thesis' motor, rad/s per rad: its protocol has 6.3, the rich one 7.4. Another pace
is taken for it by octaves; at half an octave from 7 (0.8 and 1.6 Hz) the next one begins."""
QUICKEST_OCTAVES = 1
"""The quickest run is quicker than the usual one by so many octaves at most, as in the rich protocol (2 Hz).
Runs of 0.1 Hz beside a chirp to 3 Hz had been looked at up to 2 Hz: what friction does at a reversal was
lost, and joints that rub by Stribeck's law left 5.4 floors in place of 1.7."""
MOVING_SHARE = 0.99
"""Share of a motion's variance by which its pace is told: the rest is noise and small steps; assumed."""
PACE_SAMPLES = 65536
"""So many samples of a run tell its pace at most."""
LEAST_ALIKE = 3
"""Runs of a kind from which on one of them is odd, and so many for each that is; assumed: two that differ do
not tell which."""
DISAGREEING_SHARE = 0.6
"""Share of all that the best model misses which lies in a run that disagrees with the others; assumed."""
GROSSLY_OFF = 15.0
"""Squared score above one from which on a run may be another bench's; assumed: four floors, where a law that
is nearly right leaves one to three, in the run that asks most of it."""
ODD_SAMPLES = 16384
"""So many samples of a run tell whether it is odd."""
ODD_CLIPPED = 0.01
"""Share of its samples at which a channel is cut off, and of those elsewhere that repeat; assumed."""
ODD_STILL, ODD_NOISE = 0.05, (0.5, 0.9)
"""Share of the others' spread, and of their noise, below which a channel stands still: it is not connected.
Correlation of neighbouring samples below which it is noise alone, and above which the others are none;
assumed."""
ODD_MOVES = 0.3
"""Share of what the motor does in the others from which on it moves, or pulls, as in them; assumed."""
ODD_FORCE, ODD_FOLLOWING, ODD_GEOMETRY = 0.1, 0.3, 0.01
"""Share of the force in contact below which none is read, and beyond which the tip is pressed; of a command
by which a motor does not follow it; of its travel by which a run is off the others' geometry; assumed."""
ODD_TIMES, WELL_APART = 10.0, 5.0
"""... and so many times what the others show; so many times as far off their geometry as any of them, and as
with the channel that is turned round; assumed."""
LEAST_RATE_HZ = 60.0
"""Samples in a reduced second at least: seven in a cycle of the narrow cutoff, below which the band itself is
lost; assumed."""
READ_SAMPLES = 4096
"""So many samples of a run tell how often its channels are read."""
LEAST_READINGS = 64
"""A position with fewer readings in these does not show the motion; assumed."""
QUICKER_OCTAVES = 2
"""By so many octaves short runs are looked at more quickly than their pace asks for, at most; assumed."""
USUAL_TORQUE_SPREAD = 0.04
"""Standard deviation of the torque of the thesis' motor alone, N m: what its size is taken by where no finger
tells; assumed."""
BAND_OVER_HALF = 1.25
"""Cutoff over the frequency below which half of the torque's variance is, if a motor turns on; assumed."""
OVER_NOISE = 10.0
"""A line of a spectrum is none of noise that has so many times the mean power of those of its upper half: of
20,000 lines of white noise one has."""
USUAL_TRAVEL = 0.2
"""A motor that moves further has travelled this far, root mean square, rad, as far as its pace is concerned:
16 degrees to either side, as in the thesis' protocol."""
USUAL_SPEED = USUAL_PACE * USUAL_TRAVEL
"""Speed of the thesis' motor, rad/s, root mean square."""
LEAST_TURN = 0.05
"""A motor alone of which no run moves as far has a unit of angle of its own, rad, root mean square: 4 degrees
to either side, which the proposed small sines reach. An axis along a line has no whole turn to keep, and
one below USUAL_TRAVEL; what gives way over degrees of a motor does so over micrometres there."""

# ## Which part of a run is looked at, and how finely

LONGEST_STRETCH_S = 60.0
"""A longer run is cut, so that memory does not grow with its length, s."""
SETTLING_S = 2.0
"""Left out at the start of a run: the ramp from rest (1.5 s on the bench) and the end of its transient, s."""
SETTLING_SHARE = 1.0 / 3.0
"""... and of a short run no more than this share: it has a shorter start, or little to spare; assumed."""
AT_ONCE_S, AT_ONCE_STEP_S, AT_ONCE_SHARE = 0.3, 0.05, 0.5
"""... and so much, s, of a log that begins in the middle of a motion: whose speed, told over steps of so many
seconds, is in this time so large a share of what it is over all. A ramp of 1.5 s has a tenth; assumed."""
SHORTEST_STRETCH_S = 2.0
"""A stretch that is shorter is left out, s; assumed: at either end the filters take a share of it."""
OFTEN_STILL = 0.01
"""Share of the samples at which a channel stands that shows its step; assumed: it is small beside the motion
where fewer do."""
LEAST_WAIT = 3
"""Samples in a row that read one count of an encoder, from which on its edges tell more than the count: two
edges that are half a sample uncertain each, against a position anywhere in the count. At least half a period
of the filters' cut-off, too."""
USUAL_LAG_S, USUAL_LAG_SAMPLES = 0.002, 2.0
"""A motor's torque is logged later than its position by about so much, or so many samples: its current is
filtered, a bus hands either on; assumed. Up to ten times as much is looked for."""
EARLY_LAGS = 3.0
"""... or earlier by up to so many times as much: a drive holds it for half a sample, calculates for one, and
a filtered position comes later still; assumed."""
LAG_AT_EDGE = 0.99
"""Share of the latest lag from which on one is no lag: something else makes the torque late; assumed."""
LAG_SHARE = 0.9
"""It is only believed where it explains so much of what the bare model misses; assumed: where motors rub it
explains a fifth at most, and viscous friction of a light touch three quarters."""
USUAL_INERTIA = 2e-4
"""Inertia of a rotor, gearbox and pulley of which nothing is known, kg m^2; assumed: the bench's order."""
ROTOR_SPREAD = 5e-5
"""Of it what every model of a finger takes up unsaid where the rig gives no inertia, one standard deviation,
kg m^2; assumed: a quarter, so that a rotor which matters is an effect that is missing."""
COASTING_S = 6.0
"""A rotor with only a trace of viscous friction coasts this long until a third of its speed is left; assumed:
as the thesis' motor and gearbox, 2.9e-4 kg m^2 with 5e-5 N m s/rad."""
EXACT = 1e-6
"""Least tolerance that a fit knows: a constant that the rig file gives with none is held to a millionth."""
WIDE_RATE_HZ = 250.0
"""Rate at which columns are formed, Hz; six times the cutoff."""
WIDE_CUTOFF_HZ = 40.0
"""Low-pass before columns are formed, Hz: friction formed from a speed at 8 Hz looks like Stribeck's."""
NARROW_RATE_HZ = 25.0
"""Rate of the signals that are summed, Hz; three times the cutoff."""
NARROW_CUTOFF_HZ = 8.0
"""Low-pass of measured signals and columns alike, Hz; assumed: protocols move below it."""
NARROW_TAPS = 81
"""Length of that low-pass, samples at the wide rate."""

# ## Samples that are no measurements

LONGEST_BRIDGE_S = 0.012
"""A gap of so long is bridged, s: a tenth of a period at the narrow cutoff; one lost sample at any rate."""
LEAST_JITTER = 0.01
"""Times that scatter by less than this share of a sample are even: at 1 kHz 10 us, a rounding of the log."""
STRAIGHTER = 0.98
"""Where its times are true a motion bends by less than this share of what it does by number; assumed: an
encoder's noise makes it 1, and then nothing is gained by them."""
REPORTED_JITTER = 0.1
"""A sample that is off its time by more than this share of a sample came early or late; assumed."""
LANDING_S = 0.05
"""So long before and behind what looks like a spike of the force it is asked whether a tip was clear and then
presses, s: a tip that lands knocks, bounces for some 10 ms and stays. Assumed."""
LANDED_SCATTERS = 4.0
"""A tip has landed where the force is then higher by so many times what it scatters by before, or its step;
assumed."""
LEAST_SPIKE = 12.0
"""A spike is off by so many times what a channel bends by from sample to sample, or its step; in recordings
of seven machines, clean ones, nothing but impacts is off by more than ten."""
LEAST_SPIKE_LOCALLY = 6.0
"""... and by so many times the scatter of its neighbours: where the motion is fast, they scatter, too."""
SPIKE_NEIGHBOURS = 4
"""So many samples on either side of a spike are its neighbours."""
PULSE_SAMPLES = 3
"""Spikes in so many samples in a row are a pulse that is kept: of spikes by chance, not one in a thousand."""
END_JUMP = 8.0
"""The first and the last samples are spikes that are off by so many times what the channel ranges over in
twice as many beside them; assumed: a motion that goes on is off by less than two."""
MOST_SPIKES_SHARE = 0.02
"""A channel with a larger share of spikes is of that kind, and is left as it is; assumed."""

LEAST_SPIKES = 5
"""Fewer spikes of a channel in all runs are left aside without a word."""
JUMP_STEPS = 4.0
"""So many steps of its own a channel has to jump for the next sample to be asked whether it moves on."""
STANDING_SHARE = 0.75
"""... and in so many jumps it must not: one that is read with each sample does in nearly all; assumed."""
SAME_SIZE = 0.05
"""Changes that differ by less than this share of the smallest differ by rounding; assumed."""
LEAST_JUMPS = 20
"""With fewer jumps nothing is said of how often a channel is read; assumed."""

# ## Channels whose sense is turned

CLEARLY_HELPING = 0.4
"""Correlation of torque with speed beyond which a bench's torque is read as a reaction; assumed."""
CONTRADICTED = 0.25
"""Share of a session's runs of the other sense, from which on that is believed; assumed: of seven or
eight runs of two machines one had been turned for how it happened to go."""
LEAST_RUBBING = 0.3
"""What helps or opposes the motion tells the torque's sense from this share of its scatter on; less is what a
torque that leads by 5 ms, of a machine without friction, does at 10 Hz."""
NO_TORQUE = 1e-9
"""A torque that changes by less is a constant, N m: rounding."""
MOVED_DEG = 3.0
"""A joint that moves by less says little of its sense, degrees; assumed."""
TURNED_CORRELATION = -0.7
"""Correlation with what its cable does below which a joint turns against it; assumed."""
PUSHES_N = -0.5
"""A mean tension below it is no zero of the current, N; assumed."""
PUSHING_SHARE = 0.9
"""Share of a run in which a cable would have to push to be called turned; assumed."""

# ## Channels that contradict each other

ANOTHER_UNIT = 20.0
"""A ratio that is off by such a factor is a matter of units (57.3 or 1000), not of a bench; assumed."""
OFF_CURRENT = 1.5
"""... for the torque over what the current makes of it, which are one measurement."""
COMMAND_CORRELATION = 0.9
"""A motor whose position and command correlate below minus this turns against it; assumed."""
SAME_TORQUE = 0.05
"""Torque and current are told of each other where they differ by less by the rig's constants; assumed."""
DEAD_SHARE = 0.02
"""A joint that moves by less than this share of the other one does not move; assumed."""
LEAST_ARM_M, LARGEST_ARM_M = 0.001, 0.08
"""A joint's moment arm lies between, m: twice beyond what a fit allows."""
FIRST_LOOK_S = 4.0
"""So much of a run is looked at beside its command and its current, s; assumed."""
SWING_SAMPLES = 2000
"""So many samples tell how far a channel swings; assumed."""
PULLS_SHARE = 0.2
"""Of its mean a tension swings by more, where a load cell has to show it; assumed: less may rub away."""

# ## Runs of one condition

SAME_SHARE = 0.15
"""Numbers that differ by less than this share are the same condition; an approach is never found twice."""
SAME_DIFFERENCE = {"frequency_hz": 0.02, "amplitude_deg": 1.0, "offset_deg": 3.0, "load_torque": 0.002}
"""... or by less than this (Hz, degrees at the pulley, N m)."""
MOST_FOLDS = 30
"""Folds of a group, whatever the number of its conditions: beyond, conditions share folds."""
FEW_RUNS, SPLITS = 2, 2
"""So many runs of a motor alone, or one, in which no motion comes again, are held out in so many turns, the
first half of each and the second; assumed. Of two, one slow and one fast, neither tells what the other holds;
one has no other. In shorter parts what wanders is told by its neighbours: by eighths the floor of a machine
whose friction wanders by 2 % was a half, and another friction seemed missing."""
FOLDS = 10
"""Runs of a condition are dealt to at most this many folds; ten runs or fewer are held out one by one."""

# ## What every model leaves open

FIRST_ARM_M, FIRST_ARMS_M = 0.01, (0.003, 0.035)
"""A fit starts at moment arms within these, m; at the first where nothing tells any; assumed."""
MOST_CHANGES = 6
"""So many known changes of the machine are told apart, assumed: more are not made for one question."""

LIFTED_M = 1e-4
"""A tip that is higher or lower than this (twice this: for certain) than where it presses has let go, m;
assumed: several times what the joint angles' noise moves it by."""
TIP_STIFFNESS = 1 / 3e-5
"""Sideways force over the friction coefficient that a tip which sticks takes on with travel, N/m: 1 N over
about one angle step at the tip; assumed."""
SLIP_STIFFNESSES = (2.0, 6.0, 18.0)
"""Sideways over normal force, and over the friction coefficient, of a tip that sticks while the finger
presses harder or softer; assumed: the finger's posture and what gives way behind it decide."""
CURRENT_ZERO_A = 0.0025
"""How far the zero of the current measurement may be off, one standard deviation, A; assumed: half of the
5 mA in which a 16-bit card reads the monitor of a 5 A drive."""
USUAL_RATIOS = (1.10, 0.76)
"""Flexion over extension arm at MCP and PIP; assumed. In thirteen recordings of finger benches that the
project did not make it is 0.97 to 1.32 and 0.61 to 0.78."""
USUAL_SPREAD = 0.12
"""One standard deviation of the ratio's logarithm between fingers of one design, each joint; assumed."""
ARM_RATIO_SPREADS = 2.75
"""How many of them the two joints together may be away: one finger in forty is."""
ARM_RATIO_CURVATURE = 1e7
"""Curvature of the cost beyond the edge, for a ratio's logarithm: ten times what a session tells of it."""

# ## Moments that count otherwise: a slack cable, a motor that stands

SLACK_TENSION_N = 0.12
"""Below this tension the cable may be slack, N; assumed: a few times the noise of the current at 8 Hz."""
SLACK_NOISES = 4.5
"""... or below so many times what it differs by from its mean over 36 ms, at the median: on a bench with
soft springs the same current's noise is a larger share of what the cable carries."""
INERTIA_SPREADS = 2.0
"""... and more where the rotor speeds up: its inertia may be off by so many standard deviations."""
TENSION_SAMPLES = 9
"""So many samples at the wide rate, 36 ms, a tension is averaged over first: its own noise is then small."""
SLACK_REACH, STUCK_MIX = 7 / 8, 3 / 4
"""Shares of the low-pass' reach on either side of a moment that it spoils: of a slack one, which hangs
through by millimetres where a taut cable is known to micrometres, and of a motor that sticks, of which what a
window holds beyond weighs less than a hundredth."""
AT_REST_DEG = 0.1
"""A motor stands that turns by less than this in a sixth of a second; assumed: two steps of its encoder."""
REST_REACH = 2
"""Decimated samples on either side of a moment that are looked at for it: five make the sixth of a second."""
STUCK_REACH, STUCK_STEPS = 5, 4.0
"""Samples at the wide rate on either side of a moment that are looked at for a motor that sticks, at most (40
ms together): as few as see it move by so many steps of its encoder at its usual speed; assumed."""
STUCK_SHARE = 0.01
"""It stands where it moves by less than this share of what it usually does, or than a step of its encoder; at
its usual pace a sine that turns round does not."""
PULLED_SHARE = 0.07
"""... and sticks where its torque changes by this share of its spread meanwhile; assumed: noise is less."""
SLACK_SPREAD_M = 1e-4
"""Cable that may hang loose at no tension before that is called slack, m; assumed."""
LOW_PASS_REACH = 1
"""Decimated samples by which a standstill is longer than it seems: the low-pass rounds the corners of the
angle, and carries what was held over them. Without it, the ends of a standstill were weighed as motion, and
one run of steps took a third off the joints' friction; with two, reversals that tell where it rubs were
doubted."""
STICTION_MEAN_SQUARE = 1.0 / 3.0
"""Mean square of a friction anywhere between its extremes, as a share of its square when it slides."""

# ## What repeats, and how far an equation is trusted

TREND_DEGREE = 3
"""Of the polynomial over a stretch that counts as its slow trend."""
MOST_HARMONICS = 0.6
"""Share of a stretch's samples that its motion's harmonics, sine and cosine, may number: more would follow
its noise; assumed."""
MOST_NOISE = 0.995
"""Noise may make up at most this share of any combination of features."""
GRAM_RIDGE = 1e-9
"""Share of its own size below which a combination of features is rounding."""
TIP_FRICTION_SPREAD = 0.3
"""Share of its friction at the fingertip that a tip which slides holds back or adds at will, one standard
deviation; assumed. It is as good as noise to all else: only the tip's own law could tell it."""
LEAST_TENSION_SPREAD_N = 1e-3
"""No equation of a joint is trusted beyond this spread, N: about a tenth of the sensors' resolution."""
LEAST_LENGTH_SPREAD_M = 5e-7
"""The same of the cable's length, m."""
LEAST_TORQUE_SPREAD = 1e-6
"""The same of the motor alone, N m."""
LEAST_DEPTH_SPREAD_M = 3e-5
"""Nor is where a tip stands that presses, m; assumed: it is rough, and rolls, and half an angle step moves it
by as much."""
RUN_VARIATION = 0.05
"""Friction differs from run to run by this share, one standard deviation; assumed ("some per cent")."""
RUN_VARIATION_BOUND = 3.0
"""... and by no more than so many of them: a friction that does depends on something, such as the load."""
SET_DOWN_N = 0.02
"""Force along the load cell's face that a tip which sticks is set down with, from run to run, one standard
deviation; assumed: a tenth of what friction of 0.2 holds at 1 N."""
LEAST_REPEATS = 3
"""Runs of one condition from which on their differences are known to be the runs', not the condition's."""

# ## How well any law of the motor's state could tell a signal, where no motion comes again

STATE_SPEEDS = tuple(0.01 * 4.0**k for k in range(7))
"""Speeds about which friction may change, rad/s: any function of speed is made of them; assumed."""
STATE_TRAVELS_DEG = (0.1, 0.4, 1.6, 6.4)
"""Travels over which friction may build up after a reversal, degrees; assumed."""
STATE_ORDERS = 3
"""So many lines of the torque's spectrum over the angle; assumed: a ripple and its double are two."""
STATE_MEMORIES_S = (0.02, 0.08, 0.3, 1.2)
"""Time constants of a memory, s at the thesis' pace; assumed."""
STATE_RESONANCES_HZ, STATE_DAMPING = (1.5, 3.0, 6.0, 12.0), 0.1
"""Where a transmission may swing, Hz at the thesis' pace, and its damping; assumed."""
LEAST_OWN_SHARE = 0.8
"""A law of each run's own is asked where this share of the time lies in runs long enough for one; assumed."""
MUCH_THE_SAME = 3.0
"""A law of each run's own that leaves less than so many times what it leaves with the past does without it;
assumed: it leaves 1.04 times as much of an inertia of each run's own, 8 and more of a shaft or of play."""
STATE_RIDGE = 1e-6
"""Ridge as a share of a function's own size: functions are much alike, and numbers have sixteen digits."""
STATE_LEAST_GAIN = 0.02
"""Share of the squared error on what was left out by which a further function must lower it; assumed."""
LEAST_STATE_SHARE = 1e-6
"""A law of the state lowers the mean square of a residual to this share at most: sums have sixteen digits."""
LEAST_NOISE, TOLD_BY_MEMORY, TOLD_BY_PATH = 0.02, 0.3, 0.5
"""What a law of the state leaves is no noise where models leave this share of the torque's variance, a law
with memory or of each run's own less than a third of that, and a path explains less than half of what those
would; assumed. Of 116 simulated one-axis machines and nine real logs it holds for three with a transmission
that winds up, one with play, two with an inertia of each run's own, and one whose friction sticks at 50 Hz.
A law with memory tells four fifths of the real cogging's floor, too, but the ripple explains far more."""
STATE_BLOCK = 50
"""Decimated samples of a block, about 2 s: a single run is left out by such blocks."""

# ## Constants that every run has of its own

ONE_WAY, ONE_WAY_POINTS = 0.8, 2000
"""Share of a run's travel by which its ends lie apart if it goes one way, told of so many points; assumed."""
STANDING_LOAD = 0.1
"""A load stands that varies in a run by less than this share of what it differs by between runs; assumed."""
STILL_LEFT = 0.25
"""Share of the misfit that may be left where constants of runs which repeat no motion are taken for real;
assumed."""
HALF_LEFT = 0.5
"""The same where beside them nothing more is found to be missing, or the path ends near the floor: sensors
that wander slowly have half of it or more in the runs' averages, a law that is missing has most of it within
the runs; assumed."""
LEAST_CONSTANTS = 0.01
"""Log density by which every value of repeated runs must gain from such constants, or there are none: a
squared score of 0.02. Clean benches gain 0.001 at most; 30 mA of an amplifier or 0.4 degrees of a sensor gain
about 10."""
LEAST_SHARE_OF_CONSTANTS = 0.002
"""... and every kind of channel must bring this share of the gain: a moment arm that is off by 5 % makes an
angle's zero look a little like the motor's; assumed."""
SPRING_SPREAD, SPRING_RANGE = 0.2, (0.4, 2.5)
"""... beyond what springs of another stiffness would: by how much of the nominal one, one standard deviation,
and how far at most; assumed: springs out of one box scatter by half of it."""
AS_WELL_TOLD = 3.0
"""Nats up to which the joints' zeros may have moved instead of the motor's, or the other way: 20 to 1."""
REPORTED_OFFSET = 3.0
"""A zero is said to move that moves by so many times what it is known to; assumed."""
REPORTED_KNOCK = 0.1
"""Share by which a knock was harder or weaker than it was read from which on it is told; assumed."""
REPORTED_ONE_SIDED = 0.1
"""Share of a motor's friction from which on a constant torque may be more of it in one direction; assumed."""
REPORTED_SHARE = 0.4
"""... and by this share of what the zero that moves most does; assumed."""
REPORTED_ZERO_DEG = 0.1
"""A zero of an angle sensor that moves by less is not told, degrees: joints that come to rest in their
friction look like it, and a sensor that is clamped anew repeats no better; assumed."""
REPORTED_SKEW_S = 4e-4
"""From here on a skew between the channels is told, s: friction that no model holds makes 0.3 ms of it."""
MOST_READING_LAG_S, LEAST_READING_LAG_S = 0.06, 1e-3
"""A channel's reading is late by up to so much, s, as of a filter of 3 Hz; below the least the skew of a card
and the tip's friction look like it; both assumed."""
MOST_READING_GAIN = 0.5
"""The torque's scale is off by up to this share: a monitor's range that was set to another one; assumed."""
MOST_ANGLE_ZERO, MOST_ANGLE_GAIN = 0.2, 0.2
"""An angle sensor's zero is off by up to so much, rad, and its scale by this share; assumed: 11 degrees are
seen by eye, and a fifth in the first motion."""
LEAST_IN_CONTACT = 0.25
"""An error of the load cell is looked for where contact has this share of what is left: it explains nothing
in free motion, but a law that is fitted to both has its misfit spread over both; assumed."""
MODELS_BESIDE_ERRORS = 3
"""Beside so many models, the nearest, an error is looked for: what it hides is seldom further; assumed."""
ZERO_PASSES, ZERO_ROUNDS, SETTLED_ZERO, STILL_FALLING = 4, 6, 0.1, 0.8
"""Zeros of single runs are found beside a law so often at most, until the last change is a tenth of them
(beside a stop several times as stiff as its spring two rounds are too few); then the law's shapes are looked
at once more, so often at most and while a fifth less is left; assumed."""
MODELS_BESIDE_ZEROS = 3
"""Beside so many models, the nearest, zeros of single runs are taken off; on four benches with a stop,
springs that harden or slack one of the first two led to the law."""
MOST_CORRECTIONS = 2
"""So many channels are corrected in turn; assumed."""
CORRECTION_ROUNDS, SETTLED_LAG = 8, 0.02
"""Late angles and torques are corrected so often at most, until this share of the lag is left: their laws are
not linear; assumed."""
CLEAR_SAMPLES = 4
"""Samples of the wide rate that are averaged before it is asked where the tip is; assumed."""
LEAST_MOVED = 0.2
"""Share of their mean that zeros are apart by, or they are told as one; assumed."""
LEAST_FORCE_ZERO, ZERO_SPREADS = 0.02, 5.0
"""What a load cell reads with nothing on it is taken off from this share of its readings in contact on, twice
what its span may be off by (FC2231 data sheet), and so many times what it scatters by; assumed."""
PRESSING_SHARE = 0.15
"""Of the force between its least and its most: a tip that is read to press with more does press; assumed."""
MOST_TIP_FRICTION, MOST_STICKING_SHARE, STICKING_SHARE = 0.4, 0.25, 0.1
"""Friction coefficient of printed parts at most; and the share of the normal force that a tip which sticks
may hold along the face, at most and one standard deviation: as of one that slides to and fro; assumed."""
LEAST_TIP_TRAVEL_M, TIP_AVERAGE_S, SETTLED_TIP_SHARE = 1.5e-5, 0.1, 0.2
"""A tip sticks that moves along by no more than this beyond what it gives, m, in averages over so long, s:
half an angle step (KMA210: 0.04 degrees) at the tip. It is asked behind this share of the run; assumed."""
CLEAR_S, CLEAR_SLOPE = 0.3, 0.03
"""A tip that presses shows the load cell's zero where it is clear of it for so long, s, and the reading there
goes with its place, one standard deviation, by no more than this share of what presses the cell; assumed:
noise of 1 % and a tip that has let go give less, one that is soft or rubs on gives more."""
FORCE_ZERO_RUNS = 6
"""Runs of either kind that are looked at for it, evenly among all: enough for their scatter."""
MOST_FORCE_ZERO_N = 2.0
"""Where it was never read without a load, it is sought up to here on the scale of the thesis' finger, N: four
per cent of the cell's span; assumed."""
RUN_CONSTANT_RANGE = (1e-5, 0.5)
"""Between these a spread is sought: from half a thousandth of a degree to half a turn's sixth, and in N m on
the scale of the thesis' motor; assumed."""
SPREAD_STEPS = 29
"""Steps of that grid, a factor of 1.5 each: a spread need not be known better to be integrated out."""
CONSTANTS_ROUNDS = 6
"""Times that constants of runs are looked for, at most: each round a model that was fitted beside the last
ones bends less to them; three to five are enough."""

# ## How much is kept and done at once

AT_ONCE = 64
"""So many signals are filtered together: they fit into the processor's cache."""
MOST_FOLD_BYTES = 16_000_000
"""So much of the products of models' features in single folds is kept: of some five models; more made nothing
quicker."""
MOST_CLOSER = 8
"""So many reductions of refined grids are kept, each of a few megabytes."""
MOST_REMEMBERED = 200
"""So many models at the best of finer shapes are kept: seven rivals of five passes are looked at twice, and
where fewer were kept than one look makes, none was there for the second."""
MOST_LOOKED_AT = 40
"""Runs from which the shapes of an effect are read beforehand, at most: evenly among all."""
TASKS_AHEAD = 2
"""Runs that a second process is given at a time: one at work and one waiting."""
MOST_BYTES = 96_000_000
"""So much is kept in each process, about fifty runs of half a minute; longer recordings are read again."""

# ## How a fit ends, and constants that go together

USUAL_LOSS_NM = 2e-4
"""Scatter of losses that count as none, N m; assumed: 0.2 degrees of a joint's zero on 60 mN m/rad."""
SIMPLER_FIRST = 2.0
"""What a gain costs of which the data tell nothing: the simpler effect comes first, both are in the set."""
SETTLING_ITERATIONS = 4
"""With fewer, a fit only looks round, and friction at rest is taken as it was at the start."""
LEAST_GAIN = 1e-3
"""A step that lowers the cost by less than this is the last; the cost is twice a log probability."""
LEAST_GAIN_SHARE = 1e-6
"""The same as a share of the cost."""
WEAK_PRIOR = 0.01
"""Weight of the prior of what nothing is known of: arms, offsets, and gains of effects."""
PIVOTING_ROUNDS = 40
"""Exchanges of bounds after which the slower, certain way is taken."""
FULL_ITERATIONS = 8
"""A fit of so many iterations is meant to end, not to look round."""
MOST_ITERATIONS, USUAL_ITERATIONS = 12, 10
"""Steps of a fit at most where nothing else is said, and of a model beside others; assumed: a fit ends before
where a step lowers the cost by no more than ``LEAST_GAIN``."""
STEP_FRACTIONS = (1.0, 0.5, 0.2, 0.05)
"""Shares of a Newton step that are tried until the cost falls; assumed: where a twentieth of it does not
lower it, the fit has ended."""
OWN_WEIGHTS = 0.5
"""Weights that differ by no larger share from a model's own do as its own where densities are compared;
assumed."""
SETTLED = 0.05
"""Weights that change by no larger share belong to their fit: a score then changes by some per mille."""
MOST_ROUNDS = 8
"""Times that a model is fitted and weighed again, at most."""

HOPELESS = 5.0
"""A model whose deviance for each value is so much above the best one's will not be the likeliest under its
own weights; assumed: those that were had at most 3 more after the first round, others 40 and more."""
OTHER_FLOORS = 1.0
"""By how much the weight of an equation differs, up or down, for a model's floors to be others than those in
which it was judged: by a factor of two; assumed, noise is told to some tenths, and that of angles in what a
joint rubs makes it ten times as large."""

# ## When a step of the path is justified

CORRELATED_VALUES = 16.0
"""Independent noise values within one correlation time (about a second) of a systematic misfit; assumed."""
STROKE_VALUES = 4.0
"""... and in half a stroke, below which a misfit of friction or inertia does not come again."""
VALUES_OF_A_MOTION = 14.0
"""So many systematic values a run of one motion has in any case: sine and cosine of seven harmonics, as a
stroke of the thesis' pace has them below the narrow cutoff."""
OVERFIT_SHARE = 0.001
"""Share of the explained misfit that every further unknown of a run gains by chance and bias."""
OVERFIT_MOST = 100.0
"""... of a fall of the squared score up to this: what chance gains does not grow with friction of sixty times
the floor, where a law with one unknown less would be preferred although it leaves four floors more."""
LEAST_SHARE = 0.2
"""A missing effect must explain this share of the reproducible misfit, or nothing is missing."""
LEAST_FALL = 0.05
"""... and lower the squared score by this much: below, the misfit is a matter of sensor steps."""
LEAST_FALL_BEYOND = 0.2
"""The same for a model that holds an effect already: its own law is never quite the plant's."""
CONTACT_PENALTY = 0.1
"""... and by this much more where it explains runs in contact alone: how a tip rubs and settles is never
described to the end, and a lean of the force takes up what is left."""
CONTACT_SHARE = 0.6
"""An effect of whose gain this share lies in contact explains the contact."""
NEXT_SHARE = 0.4
"""A second effect must explain more of what is left: the first one's own law is never quite the plant's
(where a joint sticks, say), and a partner that only mends that law is not missing physics."""
FAR_LEFT = 3.0
"""Squared score above one beyond which that does not hold: a friction's own law leaves less; assumed."""
DECIDING_LOG_ODDS = 5.0
"""Log odds that decide (about 150 to 1)."""
USUAL_FREEDOM, USUAL_POINTS = 3, 9
"""Unknowns and points of the grid of an effect that is no more flexible than most; what others gain by chance
comes on top, ``COST_OF_A_GAIN`` an unknown and the logarithm of how many times as many points there are."""
LACK_OF_FIT = 1.0
"""Squared score above one that no bench leaves (``USUAL_LEFT``) and no nearly right law (about 0.5)."""
NEARLY_RIGHT = 0.4
"""Squared score above one up to which several effects together are taken for right; assumed."""

# ## Which effect, if one is missing

SYSTEMATIC_VALUES = 16.0
"""Independent values that a session's systematic misfit is worth, however long it is: what no model explains
is the same in every run. Found on blind trials of the simulated bench for odds by the ratio of whole scores;
the present form was chosen on such trials, too, and is not cross-validated."""
USUAL_LEFT = 0.14
"""Squared score, above one, that every model leaves of a bench: half of the plain benches of the population
leave less, bench-plain 0.05; it tells nothing."""
LEAST_DIFFERENCE = 0.1
"""Two models whose squared scores differ by less than this leave about the same: of a bench that is not ours
something small is missing everywhere. With 0.02 the mean log loss of the true effect was 0.26 on trials of
the twin, 0.60 on the second engine's and 0.65 on benches of a tester's; with this 0.19, 0.52 and 0.52."""
COST_OF_A_GAIN = 0.5
"""Log odds that a further unknown must overcome."""
UNLIKE_SHEATHS = 1.5
"""How far the shares that two cables' sheaths take lie apart, one standard deviation of the logarithm of
their ratio; assumed: a cable in the palm may run nearly straight, with a ninth of the other one's bends."""
LEAST_EXCESS = 0.2
"""Share of a friction by which that at low speed is usually larger at least where one speaks of Stribeck's;
assumed. The unevenness of a simple law of friction is taken up by a smaller one."""
EXCESS_SPREAD = 0.3
"""How far below it may lie, one standard deviation of its logarithm; assumed."""

MOST_PAIRED = 8.0
"""Log odds by which what models leave of a pair's difference tells them apart at most; assumed: a fit has
seen both runs, so that they count a second time."""

# ## When an effect is missing

UNKNOWN_SHARE = 0.65
"""An effect outside the catalogue is thought to explain this share of the misfit."""
UNKNOWN_LEAST = 0.5
"""... and is not thought of where the squared score is above one by less than about this: a misfit that small
comes from what every bench does a little (rubbing at the fingertip, joints that stick)."""
UNKNOWN_LEAST_BEYOND = 6.0
"""The same for a model that holds an effect already, whose own law is never quite the plant's."""
PRIOR_NOTHING, PRIOR_UNKNOWN, PRIOR_EFFECTS = 0.5, 0.05, 0.45
"""Probability before anything is seen: of nothing missing, of something unknown, and of all effects of the
catalogue together; assumed."""
TRACE_STRENGTH = 0.03
"""Below this share of its typical strength an effect is a trace, which plain benches have, too: friction that
grows with load of 0.07 % was told of one. Of what blind trials hid nothing came out below a fifth."""
SET_PROBABILITY = 0.95
"""The set holds effects until they have this probability together, if one of them is missing."""
SET_LOG_ODDS = 3.0
"""An effect is in the set when its log odds against the best are above minus this (odds of about 1 to 20)."""
TIE_LOG_ODDS = 1e-6
"""Log odds by which, of two effects as likely, the one that the path begins with stands first."""
FAR_LOG_ODDS = -12.0
"""Log odds below which an effect that was looked at once, under the weights of the best, is not looked at
more closely: 0.35 of the squared score where the best is right, and about as much as that leaves where it
leaves much; assumed. In 67 ties of recordings a closer look took 0.45 off a rival that was 1.1 behind."""
GRID_LOG_ODDS = -6.0
"""Log odds down to which effects are looked at between the points of their grids where the best leaves much;
assumed: of a sheath the grid left 3.8 floors, 3.6 below a friction by load, and its own best shape 1.4."""
RUN_LOG_ODDS = float(np.log(100.0))
"""A run is proposed until the best is a hundred times likelier than the next: what a law lacks, or a tip does
that no law here tells, moves odds by several."""
IMPOSSIBLE = -700.0
"""Log odds that leave no probability."""
NOT_BORNE_OUT = 0.05
"""Share of their probability that effects keep when adding the best of them is no justified step."""

# ## Other models of the same recordings

RIVAL_SHARE = 0.5
"""An effect that gains less than this share of what a given effect does is not tried in its place; assumed:
one step of its gains tells it to some tens of per cent."""
GRID_SHARE = 0.07
"""Share of what an effect gains that the nearest point of its grid may lack; assumed."""
CLOSER_RIVALS = 2
"""So many are looked at between the points of their grids."""
REPLACING_SHARE = 0.5
"""An effect is rather in place of a given one than beside it if that is more than this share of its
probability."""
RIVAL_LOG_ODDS = 0.5 * float(np.log(2.0))
"""Log odds from which on a model with an effect exchanged is told as the better one: twice as likely, for
what is told of effects is twice as sharp as the odds are (``effect`` in ``resources/calibration.json``)."""
DOUBTED = 0.05
"""Share of its probability that "nothing missing" keeps where a model leaves what no bench does, and that
effects keep where a path leaves so much; assumed: of blind trials with such a path, 20 in 22 lacked something
that had been left out of the catalogue."""
UNEXPLAINED, UNEXPLAINED_SHARE = 2.0, 0.1
"""A path leaves too much from this squared score above one on, if that is also this share of what was missed,
divided by the effects in it: it did in 20 of 101 trials whose effect had been left out of the catalogue, and
in 2 of 422 of the others; of two effects and more in 2 of 19 and in none of 70."""
HALF_UNEXPLAINED, HALF = 0.8, 0.5
"""... and from this squared score above one on, as it is told, if it is half of what was missed: so in none
of 1,800 right answers of blind trials, and in 2 of 148 about effects left out of the catalogue."""

ASTRAY = 1.1
"""An effect that seems to leave so many times what the model as given does was fitted too little to be told:
one more effect leaves no more, but for what it costs on runs held out; assumed."""

# ## What could not show

CLEARLY_SHOWN = 0.5
"""An effect whose typical strength changes the squared score by more than this is seen in any case."""
WEAKEST, STRONGEST = 0.5, 2.0
"""Multiples of its typical strength between which an effect that is there is thought to lie, evenly in their
logarithm; assumed."""
MOST_ODDS = float(np.exp(2.0))
"""What is below a verdict's threshold speaks for an effect by at most this factor; assumed."""
STRENGTH_POINTS = 33
"""Strengths between these at which that is looked at: a step of 4 %."""
AS_LIKELY = np.exp(-1.0)
"""An effect that the data make less likely by more than this factor has not stayed undetected."""
MOST_UNDETECTED = 0.95
"""Effects that were not seen are together less likely than nothing."""
TOLD_ODDS = 10.0
"""So much likelier than nothing an effect must be to be told as missing by what the rig's constants say
alone; assumed: of 18 plain benches the likeliest was a third as likely as nothing."""
STRANGE_CONSTANTS = 17.0
"""Chi-square of a rig's constants, of which a finger's model has nine, beyond which they are strange: 5 % of
true models have more."""
CONSTANTS_SPEAK = 6.0
"""From so much in chi-square on it is said that constants of the rig speak for an effect: 3 nats."""

# ## How odds become probabilities

LEAST_ODDS = -690.0
"""Log odds are told apart down to here: a probability of 1e-300, the least in double precision."""
MOST_LEFT = float(np.log(10.0))
"""What a path leaves counts up to ten floors for how far odds can be trusted: beyond, trials are few."""
NEVER_RULED_OUT = 0.1
"""What is told with this probability stands in the set; assumed: twice what all that is left out may have."""
UNUSUAL = 0.05
"""A session is unlike the trials where a smaller share of them is as far from their middle; assumed."""
WIDENING = 2.0
"""So much the log odds of a session are divided by that is unlike all of the trials; assumed: its models are
further from the bench than any that the map was fitted to."""

# ## How the catalogue is searched

HELD_OUT_TRIALS = 4
"""This many of the best effects are scored on held-out runs; the rest are far behind and scored in sample."""
CANDIDATES_REFITTED = 8
"""This many are looked at more closely when the weights have changed."""
SCREEN_SHARE = 0.1
"""An effect whose first step lowers the cost by less than this share of the best's is fitted no further."""
LEADING_SHARE = 0.5
"""Effects that explain at least so much of what the best explains may set the weights in its place, if the
recordings are likelier with them; assumed: others are seldom what is missing, and each costs a fit."""
SAME_COST_SHARE = 1e-3
"""Effects whose costs differ by less than this share leave the same noise, and set the same weights."""
CLEARLY_OFF = 3.0
"""A constant is not the rig file's from so many standard deviations on, of its tolerance and of what the runs
tell together: one bench in 370."""
BEYOND_TOLERANCE, LEFT_BEYOND_TOLERANCE = 10.0, 0.1
"""A rig file's constant is told to be wrong where up to so many times its tolerance takes off this share of
what is left: of right ones beside laws that are nearly right 0 to 3 %, on a bench of another engine with a
trace of friction 4 to 9 %, of wrong ones 11 to 64 %."""
AT_BOUND = 0.999
"""Share of a bound from which on a value stands at it."""
MOST_WIDENED = 3
"""Times that an assumed range is made ten times as wide, at most."""
LEADERS = 3
"""Times that all effects are judged under the weights of the best, at most, as another one comes first;
assumed."""
SCREEN_ITERATIONS = 3
"""Steps of a fit that only tells whether an effect is worth more."""
LONGEST_PATH = 4
"""At most this many effects are added."""
STEP_GAIN = 0.25
"""An effect that promises less than this share of what a further step must reach is no candidate for it."""
JOINT_SEARCH_LEVEL = 8.0
"""Squared score above one from which on many effects are looked for together: no usual path ends there but
for something outside of the catalogue."""
MOST_BEYOND = 2
"""Effects that are looked for beside ``effects.EVERYDAY`` on a bench that is far from its model; assumed."""
LEAST_SHARE_OF_MANY = 0.1
"""Share of the misfit that each further one explains at least, of runs left out, also beside those that come
after it; assumed. On benches as built torque ripple explains 0.15 to 0.3, effects not there mostly less."""
NEARLY_AS_GOOD = 0.75
"""Share of the best's gain from which on the plainer of two laws that are alike is taken; assumed."""
TOO_CLOSE = 0.9
"""Share of what the best explains from which on laws that are not alike cannot be told apart, so that none is
added, or that comes first which the others can spare least; assumed."""
NEEDLESS_SHARE = 0.15
"""What every bench has is needless where no equation's mean square rises by a larger share without it, and
the squared score by none as below; assumed: what many nearly right laws leave moves by as much."""
USUAL_SHARE = 0.03
"""The share of the squared score for what every bench has; assumed: it is there in any case, and stays while
it is seen at all."""
REMOVAL_SHARE = 0.003
"""The same before others are looked for, whose absence makes every share small; assumed."""
LEAST_TAUT = 0.02
"""A cable that is taut for a smaller share of the samples tells nothing of its length; assumed."""
FAR_SHARE = 0.15
"""Many effects together must leave less than this share of the misfit: several together can imitate one that
nobody knows; assumed, and moved from 0.1 for one bench as built, of which they left 0.14."""
REFINED_BESIDE_SLACK = 3
"""So many torques that pass for a slack cable's tension are refined between their grids' points; assumed."""
RUNNERS_UP = 2
"""So many other beginnings are tried where a way ends with much left."""
LOOKING_ITERATIONS = 3
"""Steps of a fit that only tells which of several shapes is best."""
SHAPE_PASSES = 2
"""Times that the shapes of several effects are gone through, each given the others', and times that all are
refined where one takes a number from what is fitted."""
OFF_GRID_PASSES = 5
"""Times at most that shapes are refined around a law that no grid holds, each around the last one's: from the
speeds at which friction is looked for first to any that is plausible; assumed."""
SHAPE_ROUNDS = 2
"""Times that one effect's shape is looked for: the weights that come with the best may prefer another one."""
NEAR_SHAPES, LEAST_NEAR_SHAPES = 0.25, 4
"""Share of the shapes, those that fitted best, that are looked at again under the weights of the best, and
how many of them at least; assumed: weights that turn the order of all would be no refinement."""
FOLLOWING_ROUNDS = 8
"""Times that a model is fitted again, at most, whose shapes take numbers from what is fitted: a delay beside
friction of the motor comes half as close each time."""
SAME_SHAPE = 0.02
"""A number of a shape that follows what is fitted has moved if it did by more than this share; assumed: the
errors of the law go with its square."""
NEAR_SHARE = 0.05
"""An effect that leaves this share more of all that is missed than the best one does may have the coarser
grid: a presliding travel half a step off leaves 2 to 3 per cent. Assumed."""
MOST_RIVALS, MOST_RIVALS_FAR_OFF = 3, 6
"""So many of a set are looked at again, the likeliest first; the latter where the best leaves much, and any
of them may lead between the points of its grid. Assumed: of four noisy runs the true friction stood sixth."""

# ## The next experiment

BENCH_LOADS_NM = (0.0, 0.05, 0.1)
"""Known loads that a motor bench is proposed with, N m; assumed."""
MOST_OF_SEEN = 1.5
"""A run of a motor alone asks for so many times the largest speed, acceleration and torque that its runs
show, at most; assumed: nobody here knows what a stranger's machine bears, and drives are bought with such a
margin."""
LEAST_PROPOSED_CYCLES = 2.0
"""A motion is slowed until so many cycles of it are left in DURATION_S; assumed."""
LEAST_PROPOSED_SHARE = 0.125
"""... and then made smaller, down to this share of the menu's amplitude; assumed."""
ALIKE_SHARE = 0.9
"""Angle and acceleration that have this share of their squares in common are those of one sine: nothing tells
whether an inertia or a spring takes the torque. Assumed."""
DURATION_S = 20.0
"""Length of a motion that is looked at, s."""
BALANCE_STEPS = 12
"""Steps in which the balance of springs, gravity and cable is sought at most."""
BALANCED_RAD = 1e-6
"""The balance is found where a joint moves by less in a step, rad."""
LEAST_PULL_N, MOST_PULL_N = 0.1, 60.0
"""A run is proposed where the cable pulls between these, N; assumed: it neither hangs loose nor hurts."""
LEAST_SEPARATION = 0.2
"""A run that is expected to bring less (nats) is not worth the operator's time."""
LEAST_MORE = 0.03
"""... nor one after which the truth is alone in the set no more probably than this beyond now; assumed."""
PROPOSAL_CANDIDATES = 7
"""So many effects of a set are looked at beside its first, or of those that could not show; more are rarely
left."""
TRUE_EFFECTS = 3
"""So many of them are looked at as the true one; the fourth is seldom as likely as one in twenty."""
LOOKED_AT = 8
"""So many runs of the menu are looked at with what gains scatter by; the rest are behind at first glance."""
GAIN_DRAWS = 24
"""Draws of that scatter: a chance is then known to a tenth; all runs have the same ones."""
SEEN_LOG_ODDS = 300.0
"""Log odds against nothing of an effect that a run was made to show, and does: hundreds in trials."""
COST_OF_CHANGE = 0.05
"""Chance that a run with a known change of the machine must bring beyond one without; assumed: it costs the
operator some minutes, and the sensors are set anew."""
FIRST_WORTH = 0.5
"""What it is worth that the truth is found and first, alone or not, if it is 1 that it is alone; assumed."""
DECISIVE = 10.0
"""A separation beyond this (nats) is worth no more: the effect is out of the set."""
WORTH_STEPS = 20.0
"""Worths are told apart to a twentieth: of two that are as good to it, the run that separates more;
assumed."""
LENGTHS_S = (DURATION_S, 60.0)
"""Lengths of a run, s; the longer one is proposed where the shorter would not decide. Assumed: an operator
spends a minute on a question rather than come back with half an answer."""
LEAST_PROBABILITY = 1e-12
"""Probabilities are compared down to here."""
WEAKEST_PRIOR = 1e-4
"""Weight of the prior, in the new run alone, of what nothing is known of: arms, offsets, gains of effects."""

# ## What is shown

SHOWN_STRETCHES = 48
"""Curves are kept of this many stretches (of at most a minute); more would not be looked at one by one."""
BINS = 15
"""Bins of a residual over a coordinate; as many as an eye follows, assumed."""
PHASE_BINS = 12
"""The same over the phase of the stroke: a twelfth of it is 30 degrees."""
LEAST_SAMPLES = 4
"""A bin with fewer says nothing."""
BINS_A_PERIOD = 4
"""Bins of a wave that must be seen for its form to be; assumed."""
OUTLYING = 0.005
"""Share of the samples at either end that does not widen the range."""
SHORTEST_S = 0.04
"""Stretches shorter than this, s, are joined with their neighbours where they lie as close."""
Z90 = 1.645
"""Two-sided 90 % of a normal distribution, in standard deviations."""
NOTHING_SEEN = 0.98
"""Share of the misfit that an effect has to leave for nothing of it to be seen; assumed."""
HARDLY_DETERMINED = 0.7
"""Share of a prior's spread that is left where the runs hardly tell a value; assumed."""
SLOWLY, STANDS_STILL = 0.7, 0.2
"""Shares of a run's usual speed below which a moment is told as slow, or as near standstill; assumed."""
LOW_LOAD, HIGH_LOAD = 0.25, 0.75
"""Quantiles of the tension of a run outside of which its load is told as low or high; assumed."""
MOST_ORDERED = 4
"""Effects whose every order is tried: each further one doubles the models that have to be fitted."""
LONGEST_LAG_S = 4.0
"""Of an autocorrelation, s: four periods of the thesis' usual motion."""
SURE = 1.96
"""Two-sided 95 % of a normal distribution, in standard deviations."""
MOST_SAMPLES = 3_000_000
"""Of a run that is read at its full rate: an hour of it is told no better by more points than pixels."""
CLOSE_ENOUGH = 0.9
"""Share of the filtered side that the channel has to tell, else it is not what is measured; assumed."""
MOST_NAMED = 1.0
"""A strength beyond this share of its plausible range is not named: none that is plausible would show."""

# ## A law drafted for what the catalogue does not explain

DRAFT_STRIBECK = (0.1, 0.4)
"""Speeds, rad/s, below which a friction may be another one; assumed."""
DRAFT_TRAVELS_DEG = (0.7, 2.0, 6.0)
"""Travels over which something may turn round after a reversal, degrees; assumed."""
DRAFT_MEMORIES_S = (0.1, 0.4, 1.6)
"""Times over which the past may count, s; assumed."""
DRAFT_ENDS_DEG = (2.5, 5.0, 10.0)
"""The last part of a joint's travel, degrees, in which an end may be met; assumed."""
DRAFT_DELAYS_S = (0.01, 0.04, 0.16)
"""Times by which channels may be late, s; assumed, up to the 0.16 s of the thesis."""
DRAFT_LATE_S = 0.012
"""Time by which a damper makes a cable's stretch late, s; assumed: the middle of the catalogue's."""
DRAFT_RANGE = 10.0
"""A coefficient lies within so many times what would make its term as large as all that is measured."""
DRAFT_LEAST = 0.5
"""Squared score above one from which on a law is drafted: plain benches leave less; assumed."""
DRAFT_LEAST_SHARE = 0.2
"""Share of what is left that every term of a law explains at least, on runs left out; assumed."""
DRAFT_LEAST_FALL = 0.05
"""... and squared score: below, the misfit is a matter of sensor steps, as for effects."""
DRAFT_NEEDLESS = 0.5
"""A term without which less than this share of that comes back is needless; assumed."""
DRAFT_TERMS = 5
"""Terms of a law, at most: a person has to read it."""
DRAFT_FRONT = 6
"""Terms that promise most at a step and are scored on held-out runs; assumed."""
DRAFT_BEGINNINGS = 3
"""So many first terms are each followed to a law."""
DRAFT_FACTORS = tuple(2.0 ** (k / 2) for k in range(-3, 4))
"""Times a term's travel, speed or time these are tried, in either sense."""
DRAFT_FINE_FACTORS = tuple(tuple(2.0 ** (k / fine) for k in range(-3, 4)) for fine in (8, 32))
"""... and times the best of these, twice: a stiff end of travel is told by tenths of a degree."""
DRAFT_LAWS = 3
"""Laws that are shown, at most."""
DRAFT_OWN_RANGE = 4.0
"""The range of a drafted coefficient in an own effect's file, times what was found; assumed."""
