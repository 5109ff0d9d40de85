// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The sections of the report, in the order in which they are measured and stand in it; see
 * report_sections.h. incise-bench(1) has the whole of each method.
 */
#include <stddef.h>
#include "report_sections.h"

#define TEXT(key, heading)                     \
	{                                      \
		key, heading, 0, PART_VALUE, 0 \
	}
#define NUMBER(key, heading, digits)                \
	{                                           \
		key, heading, digits, PART_VALUE, 0 \
	}
#define SCALED(key, heading, digits, scale)             \
	{                                               \
		key, heading, digits, PART_VALUE, scale \
	}
#define PART(part, key, heading, digits)             \
	{                                            \
		key, heading, digits, PART_##part, 0 \
	}

const struct report_promise report_promises[] = {
	{"Error against run time",
	 "Every approximation is held against a reference that is independent of it, and "
	 "what it costs is measured beside; what fails is listed."},
	{"Stable when stiff",
	 "What theory says of stability is found a second time by simulation, and enforced: "
	 "a scene that is stiffer than its device can hold is refused. No input yields NaN, "
	 "an overflow or a force over the limit."},
	{"Nothing that a scene does not need",
	 "A scene compiles to a plan; a stage that is not in it is not opened, not "
	 "allocated, not loaded and not run, and the forces are the same to the bit."},
	{0},
};

#define AGAINST_THEORY "exact_limit,colgate,gil,amplitude,quantisation,leak,break_even"

const struct report_fact report_facts[] = {
	{1, "precision", "A force by integers (fixed_table): time", "ns", "rows",
	 "name=fixed_table", NUMBER("ns", NULL, 3)},
	{1, "precision", "… its largest error", "µN", "rows", "name=fixed_table",
	 SCALED("max_error_N", NULL, 3, 1e6)},
	{1, "precision", "… the bound that is certified for it", "µN", "rows",
	 "name=fixed_table", SCALED("bound_N", NULL, 3, 1e6)},
	{1, "precision", "… how many times as fast as fuzzylite, a peer", "", "rows",
	 "name=fixed_table", NUMBER("times_fuzzylite", NULL, 3)},
	{1, "precision", "A force in double, as the paper prints it: time", "ns", "rows",
	 "name=double_libm", NUMBER("ns", NULL, 3)},
	{1, "training", "Force of unseen cuts after the default training: rms error", "N",
	 "rows", "name=default", NUMBER("rmse_unseen_N", NULL, 3)},
	{1, "training", "… time", "ms", "rows", "name=default", NUMBER("ms", NULL, 3)},
	{1, "training", "… linear regression, a baseline: rms error", "N", "rows",
	 "name=linear", NUMBER("rmse_unseen_N", NULL, 3)},
	{1, "training", "… a Gaussian process of scikit-learn, a peer: rms error", "N",
	 "rows", "name=gaussian_process", NUMBER("rmse_unseen_N", NULL, 3)},
	{1, "pose", "Pose of the loop in a cut, tracker of 120 Hz 4 ms late: rms error",
	 "mm", "rows", "name=library,motion=surgeon,delay_ms=4,tracker_hz=120",
	 NUMBER("rms_mm", NULL, 3)},
	{1, "pose", "… of the last pose that has come", "mm", "rows",
	 "name=held,motion=surgeon,delay_ms=4,tracker_hz=120", NUMBER("rms_mm", NULL, 3)},
	{1, "timeline",
	 "Time of a sample up to 20 ms late, after 30 s: largest rms error", "µs", "rows",
	 "name=line_live,window_s=30", PART(LARGEST, "rms_us", NULL, 3)},
	{1, "timeline", "… by its arrival", "µs", "rows", "name=arrival,window_s=30",
	 PART(LARGEST, "rms_us", NULL, 3)},
	{1, "loop", "A tick with all forces, on a plane", "ns", "rows", "name=plane",
	 NUMBER("tick_ns.median", NULL, 3)},
	{1, "loop", "… on a mesh of 500 000 triangles", "ns", "rows", "name=mesh_500000",
	 NUMBER("tick_ns.median", NULL, 3)},
	{1, "loop", "The loop of 1 kHz is woken late, idle machine: 99.9 %", "µs",
	 "wakeups.rows", "load=idle,rate_hz=1000", NUMBER("lateness_us.p999", NULL, 3)},
	{1, "loop", "… cyclictest at the same time", "µs", "wakeups.rows",
	 "load=idle,rate_hz=1000", NUMBER("cyclictest_us.p999", NULL, 3)},
	{1, "vision", "Exposed length in a clean picture: standard deviation", "px",
	 "rows", "name=rgb,region=follows", NUMBER("sd_px", NULL, 2)},
	{1, "vision", "… time", "ms", "rows", "name=rgb,region=follows",
	 SCALED("us", NULL, 3, 1e-3)},
	{1, "capture", "All streams recorded, vision included", "% of a core", "rows",
	 "name=full", NUMBER("cpu_percent", NULL, 3)},
	{1, "view", "Pictures a second while it bleeds, 1280 × 720, texture of 2048²",
	 "Hz", "frames", "width=1280,texture_px=2048", NUMBER("frames_hz", NULL, 3)},
	{1, "view", "… of 512²", "Hz", "frames", "width=1280,texture_px=512",
	 NUMBER("frames_hz", NULL, 3)},
	{2, "stability", "Simulated by computed limits, all experiments", "",
	 AGAINST_THEORY, "at_least=no", PART(RANGE, "ratio", NULL, 4)},
	{2, "stability", "… of these within what is asked", "", AGAINST_THEORY, NULL,
	 PART(HOLDING, "ok", NULL, 0)},
	{2, "stability", "Guard of passivity on, wall late: motions that stay bounded",
	 "", "guard", "guard=on,late=wall,share=0.5", PART(HOLDING, "bounded", NULL, 0)},
	{2, "stability", "… guard off", "", "guard", "guard=off,late=wall",
	 PART(HOLDING, "bounded", NULL, 0)},
	{2, "stability",
	 "The loop's own integrator, springs of 10 N/m to 1 GN/m: largest error",
	 "of the largest place", "integrators", "integrator=plant",
	 PART(LARGEST, "max_error", NULL, 2)},
	{2, "stability", "… explicit Euler: diverged", "", "integrators",
	 "integrator=explicit_euler", PART(HOLDING, "failed", NULL, 0)},
	{2, "extremes", "Extreme inputs tried", "", "rows", NULL,
	 PART(SUM, "tried", NULL, 9)},
	{2, "extremes", "… refused with a reason", "", "rows", NULL,
	 PART(SUM, "refused", NULL, 9)},
	{2, "extremes", "… NaN, overflow, over the limit or hung", "", "rows", NULL,
	 PART(SUM, "wrong", NULL, 9)},
	{2, "extremes", "Walls of 10 N/m to 1 GN/m pressed: motions that stay bounded",
	 "", "stiff", NULL, PART(HOLDING, "bounded", NULL, 0)},
	{3, "scenes", "Scenes whose forces are those of the full pipeline, to the bit",
	 "", "rows", NULL, PART(HOLDING, "identical", NULL, 0)},
	{3, "scenes", "Cost of a tick, as part of the full pipeline's: time", "", "rows",
	 NULL, PART(RANGE, "tick_ns/full_ns", NULL, 2)},
	{3, "scenes", "… instructions", "", "rows", NULL,
	 PART(RANGE, "instructions/full_instructions", NULL, 2)},
	{0},
};

const struct report_section report_sections[] = {
	{
		.word = "precision",
		.program = "incise-bench",
		.title = "Evaluator: error against run time",
		.question =
			"How far off is the force of a model in each arithmetic, and how "
			"long does an evaluation take?",
		.method =
			"A model of the paper's size, 20 rules. The error is taken at points "
			"spread at random over its support; the time is that of one evaluation "
			"after the other, all in the cache, the arithmetics in turns.",
		.reference =
			"An evaluation in long double, written apart from the library's. "
			"fuzzylite, where it is there, is another project's evaluator.",
		.limits =
			"Throughput, with a warm cache: the first evaluation after a pause "
			"takes longer. One model; another has other errors, and the bound "
			"is certified for each by incise compile.",
		.pictures =
			{{"",
			  "Largest error over the time of an evaluation; both axes are "
			  "logarithmic, down and left is better.",
			  "A scatter of arithmetics: double is exact and slow, tables of "
			  "integers are fast and some tens of micronewtons off."}},
		.tables = {{
			"Arithmetics",
			"rows",
			NULL,
			{TEXT("name", "arithmetic"), NUMBER("ns", "time, ns", 3),
			 NUMBER("ns_p5", "5 %", 3), NUMBER("ns_p95", "95 %", 3),
			 NUMBER("rms_error_N", "rms error, N", 3),
			 NUMBER("max_error_N", "largest error, N", 3),
			 NUMBER("bound_N", "certified bound, N", 3),
			 NUMBER("size_bytes", "bytes", 7),
			 NUMBER("times_fuzzylite", "times as fast as fuzzylite", 3)},
		}},
	},
	{
		.word = "training",
		.program = "incise-bench",
		.title = "Training: error on unseen cuts over seconds",
		.question =
			"How well does a model that is trained for so long predict cuts "
			"that it has not seen?",
		.method =
			"120 pairs of 12 cuts as in paper 1, whose force differs by 5 % from cut "
			"to cut, with noise of 20 mN; several such sets, of which medians are "
			"given. Training is in memory, the methods in turns.",
		.reference =
			"20 other cuts, whose force is the exact one. Peers are those of "
			"scikit-learn on the same data, where it is installed.",
		.limits =
			"The paper's own data are not published: the force is a made one. "
			"Other tissue has other errors.",
		.pictures =
			{{"",
			  "Error on unseen cuts over the time of training; both axes are "
			  "logarithmic, down and left is better.",
			  "Points with bars: baselines, classic ANFIS by epochs, the default "
			  "of incise, and peers."}},
		.tables = {{
			"Methods of training",
			"rows",
			NULL,
			{TEXT("name", "method"), NUMBER("epochs", "epochs", 5),
			 NUMBER("rules", "rules", 5), NUMBER("ms", "time, ms", 3),
			 NUMBER("ms_min", "least, ms", 3),
			 NUMBER("ms_max", "most, ms", 3),
			 NUMBER("rmse_unseen_N", "rms error, N", 3),
			 NUMBER("rmse_unseen_N_p95", "95 %, N", 3),
			 NUMBER("mean_abs_unseen_N", "mean error, N", 3),
			 NUMBER("max_unseen_N", "largest error, N", 3),
			 TEXT("peer", "a peer")},
		}},
	},
	{
		.word = "stability",
		.program = "incise-bench",
		.title = "Stability: how stiff a wall may be",
		.question =
			"Is a wall stable exactly as far as theory says, what does the "
			"guard of passivity add, and which integrator survives a stiff "
			"spring?",
		.method =
			"A device of 50 g in a loop of 1 kHz moves exactly between two samples. "
			"Each limit is found by trying walls until the motion grows, and "
			"never from an eigenvalue. exact_limit: the stiffest wall, over "
			"damping and delay. colgate: with the worst hand. gil: little "
			"damping. amplitude: friction. quantisation: an encoder's steps. "
			"leak, break_even: the energy that a sampled wall makes.",
		.reference =
			"Eigenvalues of the loop; the bounds of Colgate and Schenkel, Gil "
			"and Hulin, Abbott and Okamura; the solution in long double.",
		.limits =
			"A device of one mass, without the modes of a real mechanism. Where "
			"theory is a lower bound only, the ratio may be larger than 1.",
		.pictures =
			{{"map",
			  "Largest stable stiffness: points are simulated, lines computed.",
			  "Simulated limits lie on the curves of theory, over damping and "
			  "delay."},
			 {"guard",
			  "How far a motion goes with the guard of passivity and "
			  "without it.",
			  "With the guard motions stay bounded at walls where they grow "
			  "without it."},
			 {"integrators",
			  "Error of integrators on a spring of 10 N/m to 1 GN/m, in steps of "
			  "1 ms.",
			  "Explicit Euler, Runge-Kutta and semi-implicit Euler diverge from "
			  "some stiffness on; exact steps stay at rounding."}},
		.tables =
			{{"Simulated by computed",
			  AGAINST_THEORY,
			  NULL,
			  {TEXT("@", "experiment"),
			   TEXT("at_least", "theory is a lower bound"),
			   PART(ROWS, "", "cases", 0),
			   PART(LEAST, "ratio", "least ratio", 4),
			   PART(LARGEST, "ratio", "largest ratio", 4),
			   PART(HOLDING, "ok", "as asked", 0)}},
			 {"Guard of passivity, at walls of 1 to 200 kN/m that answer up to 15 "
			  "ticks late",
			  "guard",
			  NULL,
			  {TEXT("guard", "guard"), TEXT("late", "late is"),
			   NUMBER("share", "cap, of m/T", 3),
			   NUMBER("clamp_N", "clamp, N", 3), PART(ROWS, "", "walls", 0),
			   PART(HOLDING, "bounded", "bounded", 0),
			   PART(LARGEST, "late_mm", "largest way at the end, mm", 3),
			   PART(LARGEST, "largest_N", "largest force, N", 3)}},
			 {"Integrators of a stiff spring, 10 N/m to 1 GN/m; error as part of "
			  "the largest place",
			  "integrators",
			  NULL,
			  {TEXT("integrator", "integrator"),
			   {"step_s", "step, ms", 3, PART_VALUE, 1e3},
			   PART(ROWS, "", "springs", 0),
			   PART(HOLDING, "failed", "diverged", 0),
			   PART(LARGEST, "rms_error", "rms error", 2),
			   PART(LARGEST, "max_error", "largest error", 2),
			   PART(MEDIAN, "ns_per_step", "ns per step", 3),
			   PART(MEDIAN, "ns_per_ms", "ns per ms of motion", 3)}}},
	},
	{
		.word = "pose",
		.program = "incise-bench",
		.title = "Pose filter: error over rate and cost",
		.question =
			"How far is the pose that the loop is given from where the tool is, "
			"by tracker, delay and way of predicting?",
		.method =
			"Motions are known at any time. A tracker sees them late, with noise, and "
			"loses some; at each millisecond the pose shown is held against the truth. "
			"held: the last pose that has come; line, parabola: through the last ones; "
			"library: as the loop has it; the others of it are told a wrong noise, or "
			"that poses are not late. Jump is the largest step beside that of the "
			"motion: a force follows it.",
		.reference =
			"The true pose at each tick. exact_delayed is the true pose, as "
			"late as the tracker's: a tracker without noise is no better to "
			"who does not predict.",
		.limits = "Motions of a virtual hand; a real one differs.",
		.pictures =
			{{"",
			  "Error of the pose over the time of a tick; numbers are the "
			  "tracker's rate in Hz.",
			  "A panel for each motion, a curve for each way, a point for each rate of the tracker."},
			 {"rates", "Error of the pose over the tracker's rate.",
			  "A panel for each motion, a curve for each way."}},
		.tables =
			{{"Two cuts of the virtual rig, tracker 4 ms late",
			  "rows",
			  "motion=surgeon,delay_ms=4",
			  {TEXT("name", "way"), NUMBER("tracker_hz", "tracker, Hz", 4),
			   NUMBER("rms_mm", "rms error, mm", 3),
			   NUMBER("p99_mm", "99 %, mm", 3),
			   NUMBER("max_mm", "largest, mm", 3),
			   NUMBER("jump_mm", "jump, mm", 3),
			   NUMBER("rms_mm_s", "velocity, rms, mm/s", 3),
			   NUMBER("rms_deg", "angle, rms, degrees", 2),
			   NUMBER("ns", "ns per tick", 3)}},
			 {"All motions, delays and rates",
			  "rows",
			  NULL,
			  {TEXT("name", "way"), PART(ROWS, "", "runs", 0),
			   PART(RANGE, "rms_mm", "rms error, mm", 2),
			   PART(LARGEST, "max_mm", "largest, mm", 3),
			   PART(LARGEST, "jump_mm", "largest jump, mm", 3),
			   PART(RANGE, "ns", "ns per tick", 3),
			   PART(HOLDING, "failed", "failed", 0)}},
			 {"When nothing comes for a while: strokes at 120 Hz, each gap and the "
			  "100 ms after it",
			  "losses",
			  NULL,
			  {TEXT("name", "way"), NUMBER("gap_ms", "gap, ms", 3),
			   NUMBER("rms_mm", "rms error, mm", 3),
			   NUMBER("max_mm", "largest, mm", 3),
			   NUMBER("jump_mm", "jump, mm", 3)}}},
	},
	{
		.word = "timeline",
		.program = "incise-bench",
		.title = "Timeline: error of times over the window",
		.question =
			"How far is the time that a late sample is given from when it was "
			"acquired, by how much of the stream was seen?",
		.method =
			"240 samples a second by a clock that is off by −200, 0 or 200 ppm arrive "
			"up to 20 ms late, in order, and 1 % never. arrival: the time of arrival "
			"less the delay; lowest: as early as the earliest; squares: least squares "
			"of all arrivals; line: the library's line below the arrivals, live, or of "
			"all of the window afterwards.",
		.reference =
			"The true time of each sample. squares_known is told the mean "
			"lateness, which no one knows outside of a bench.",
		.limits =
			"A delay that is the same for all samples cannot be told from none: "
			"it is calibrated, see incise calibrate delay.",
		.pictures =
			{{"", "Error of a sample's time over what it costs.",
			  "A panel for each kind of lateness, a curve for each method."},
			 {"windows", "Error of a sample's time over how much was seen.",
			  "A panel for each kind of lateness, a curve for each method."}},
		.tables = {{"After 30 s, all drifts",
			    "rows",
			    "window_s=30",
			    {TEXT("name", "method"), TEXT("late", "lateness"),
			     PART(LARGEST, "rms_us", "rms error, µs", 3),
			     PART(LARGEST, "p99_us", "99 %, µs", 3),
			     PART(LARGEST, "max_us", "largest, µs", 3),
			     PART(LARGEST, "stated_us", "as stated, µs", 3),
			     PART(LEAST, "within_2sd", "within twice of that", 3),
			     PART(MEDIAN, "ns_per_sample", "ns per sample", 3),
			     PART(HOLDING, "failed", "failed", 0)}},
			   {"The library's line by how much was seen; all drifts",
			    "rows",
			    "name=line_live",
			    {TEXT("late", "lateness"), NUMBER("window_s", "window, s", 3),
			     PART(LARGEST, "rms_us", "rms error, µs", 3),
			     PART(LARGEST, "p99_us", "99 %, µs", 3),
			     PART(LARGEST, "max_us", "largest, µs", 3),
			     PART(MEDIAN, "ns_per_sample", "ns per sample", 3)}}},
	},
	{
		.word = "loop",
		.program = "incise-bench",
		.title = "Haptic loop: cost, wake-ups, and error over rate",
		.question =
			"What does a tick cost, how late does the machine wake the loop, and "
			"what does a faster loop bring?",
		.method =
			"A stroke is fed in place of a tracker, and each tick timed. Then the loop "
			"runs in real time, alone and under loads. Last, a cut into a plain wall in "
			"simulated time at several rates; the force is held against the exact one "
			"64000 times a second.",
		.reference =
			"cyclictest of rt-tests at the same time on the same processor; the "
			"exact force of the wall; hold is what an ideal sample and hold "
			"has for an error.",
		.limits =
			"In a virtual machine the host stands still at times, which is no "
			"fault of a program: cyclictest sees it, too. Poses of a tracker do "
			"not get better by more ticks.",
		.pictures =
			{{"wakeups",
			  "How late the loop is woken: histograms, logarithmic.",
			  "Histograms of lateness of the loop and of cyclictest, idle and "
			  "under loads."},
			 {"rates",
			  "Error of the force over the rate of the loop, and over "
			  "what it costs.",
			  "The error falls with the rate for exact poses, and hardly for "
			  "those of a tracker."}},
		.tables = {{"A tick with all forces",
			    "rows",
			    NULL,
			    {TEXT("name", "scene"), NUMBER("triangles", "triangles", 7),
			     NUMBER("tick_ns.median", "median, ns", 3),
			     NUMBER("tick_ns.p99", "99 %, ns", 3),
			     NUMBER("tick_ns.p999", "99.9 %, ns", 3),
			     SCALED("memory_bytes", "memory, KiB", 3, 1.0 / 1024),
			     NUMBER("load_s", "loading, s", 2)}},
			   {"How late the loop is woken",
			    "wakeups.rows",
			    NULL,
			    {TEXT("load", "load"), NUMBER("rate_hz", "rate, Hz", 4),
			     NUMBER("lateness_us.median", "median, µs", 3),
			     NUMBER("lateness_us.p99", "99 %, µs", 3),
			     NUMBER("lateness_us.p999", "99.9 %, µs", 3),
			     NUMBER("lateness_us.max", "largest, µs", 3),
			     NUMBER("cyclictest_us.p999", "cyclictest 99.9 %, µs", 3),
			     NUMBER("cyclictest_us.max", "cyclictest largest, µs", 3),
			     NUMBER("ratio_p999", "ratio at 99.9 %", 3),
			     NUMBER("skipped", "skipped ticks", 6),
			     NUMBER("skipped_by_machine", "not ours", 6),
			     TEXT("no_load", "not measured"),
			     TEXT("no_cyclictest", "no cyclictest")}},
			   {"Error of the force over rate",
			    "rates",
			    NULL,
			    {TEXT("poses", "poses"),
			     NUMBER("stiffness_N_mm", "wall, N/mm", 3),
			     NUMBER("rate_hz", "rate, Hz", 4),
			     SCALED("command.rms_N", "asked for: rms, mN", 3, 1e3),
			     SCALED("command.max_N", "largest, mN", 3, 1e3),
			     SCALED("rendered.rms_N", "rendered: rms, mN", 3, 1e3),
			     SCALED("rendered.max_N", "largest, mN", 3, 1e3),
			     SCALED("hold_N", "hold, mN", 3, 1e3),
			     SCALED("ns_per_s", "µs per s", 3, 1e-3)}}},
	},
	{
		.word = "vision",
		.program = "incise-bench",
		.title = "Vision: error of the exposed length over time",
		.question =
			"How far off is the length that is measured in a picture, and how "
			"long does a picture take?",
		.method =
			"Drawn pictures, of 640 × 480 pixels where no other width is named, with "
			"noise, blur, reflections "
			"and changing light. follows: the region of interest follows what "
			"was found; whole: all of each picture is searched.",
		.reference = "The truth that the pictures were drawn from.",
		.limits = "Drawn pictures, and not a camera's.",
		.pictures =
			{{"",
			  "Error of the length over the time of a picture; thin lines reach "
			  "up to the largest error.",
			  "Points by kind of picture; two series, the whole picture searched "
			  "and the region that follows."}},
		.tables = {{
			"Kinds of pictures",
			"rows",
			NULL,
			{TEXT("name", "pictures"), TEXT("region", "region"),
			 TEXT("method", "method"), NUMBER("found", "found", 4),
			 NUMBER("pictures", "of", 4), NUMBER("bias_px", "bias, px", 2),
			 NUMBER("sd_px", "sd, px", 2), NUMBER("rms_px", "rms, px", 2),
			 NUMBER("max_px", "largest, px", 2),
			 NUMBER("said_sd_px", "sd as stated, px", 2),
			 SCALED("us", "time, ms", 3, 1e-3),
			 SCALED("us_p99", "99 %, ms", 3, 1e-3)},
		}},
	},
	{
		.word = "capture",
		.program = "incise-bench",
		.title = "Capture: what recording costs",
		.question =
			"How much of a core does a whole capture take, and is anything "
			"lost?",
		.method =
			"Force at 10 kHz, tracker at 240 Hz and JPEG pictures at 60 Hz are "
			"recorded in real time, and with parts left out. net is without the "
			"simulation of the rig, which is no part of a real capture.",
		.reference = "What was sent is known: what is lost is counted.",
		.limits =
			"Processor time is that of the process; what the kernel does for its "
			"disk is not in it.",
		.tables = {{
			"Runs",
			"rows",
			NULL,
			{TEXT("name", "run"), NUMBER("cpu_percent", "% of a core", 3),
			 NUMBER("net_percent", "net, %", 3), NUMBER("force", "force", 8),
			 NUMBER("force_lost", "lost", 6), NUMBER("tracker", "tracker", 7),
			 NUMBER("tracker_lost", "lost", 6),
			 NUMBER("frames", "pictures", 6),
			 NUMBER("frames_lost", "lost", 6),
			 NUMBER("late_ms", "latest wake, ms", 3),
			 NUMBER("quarter_MB", "memory at a quarter, MB", 3),
			 NUMBER("end_MB", "at the end, MB", 3)},
		}},
	},
	{
		.word = "view",
		.program = "incise-bench-view",
		.title = "View: error of the picture over time",
		.question =
			"What does a picture of the scene cost, how far off is it, and does "
			"it let the loop be?",
		.method =
			"Paper 2's neck is cut, bleeds and is enlarged by a script, and drawn "
			"without a screen, by sizes of texture and picture. Without a number of "
			"pictures a second the picture is drawn at the moment itself, so "
			"that the texture alone counts.",
		.reference =
			"The same, drawn with a finer texture and more pictures a second.",
		.limits =
			"Drawn by the processor where there is no graphics card: times are "
			"then of that.",
		.pictures =
			{{"",
			  "Error of the picture over the time that a second of it takes.",
			  "Points by size of texture and pictures a second."}},
		.tables = {{"A picture",
			    "frames",
			    NULL,
			    {NUMBER("texture_px", "texture, px", 5),
			     NUMBER("width", "width", 5), NUMBER("height", "height", 5),
			     NUMBER("effects_ms.median", "effects, ms", 3),
			     NUMBER("texture_ms.median", "texture, ms", 3),
			     NUMBER("draw_ms.median", "drawing, ms", 3),
			     NUMBER("whole_ms.median", "all, ms", 3),
			     NUMBER("whole_ms.p99", "99 %, ms", 3),
			     NUMBER("frames_hz", "pictures a second", 3)}},
			   {"Error of what is shown; levels of 255",
			    "shown.rows",
			    NULL,
			    {NUMBER("texture_px", "texture, px", 5),
			     NUMBER("fps", "pictures a second", 4),
			     NUMBER("rms", "rms", 3),
			     NUMBER("rms_max", "rms of the worst moment", 3),
			     NUMBER("max", "largest", 3), NUMBER("ssim", "similarity", 4),
			     NUMBER("frame_ms", "ms per picture", 3),
			     NUMBER("ms_per_s", "ms per second", 3)}},
			   {"The loop beside it",
			    "beside.runs",
			    NULL,
			    {TEXT("load", "beside"),
			     NUMBER("lateness_us.median", "median, µs", 3),
			     NUMBER("lateness_us.p999", "99.9 %, µs", 3),
			     NUMBER("lateness_us.max", "largest, µs", 3),
			     NUMBER("cyclictest_us.p999", "cyclictest 99.9 %, µs", 3),
			     NUMBER("frames_hz", "pictures a second", 3),
			     NUMBER("skipped", "skipped ticks", 6)}}},
	},
	{
		.word = "scenes",
		.program = "incise-bench",
		.title = "Scenes: what each leaves out",
		.question =
			"Which stages, libraries, devices and memory does a scene take, what "
			"does a tick cost, and are the forces those of the full pipeline?",
		.method =
			"Each scene that ships, and some that are made, runs as it is and with "
			"every stage kept and neutral. Libraries, devices and memory are those "
			"of the process of its loop while it runs.",
		.reference =
			"The full pipeline: forces are compared bit by bit, tick by tick.",
		.limits =
			"Instructions are counted where perf stat or callgrind can; a dash is "
			"what was not counted.",
		.pictures =
			{{"",
			  "Time and instructions of a tick, each scene over its full "
			  "pipeline.",
			  "A pair of bars for each scene; the upper one, with what the scene "
			  "needs, is shorter."}},
		.tables = {{"Cost of a tick",
			    "rows",
			    NULL,
			    {TEXT("name", "scene"), NUMBER("tick_ns", "time, ns", 3),
			     NUMBER("full_ns", "full pipeline, ns", 3),
			     NUMBER("tick_ns/full_ns", "part of it", 2),
			     NUMBER("instructions", "instructions", 7),
			     NUMBER("full_instructions", "full pipeline", 7),
			     NUMBER("instructions/full_instructions", "part of it", 2),
			     NUMBER("ticks_compared", "ticks compared", 9),
			     NUMBER("ticks_in_contact", "in contact", 9),
			     TEXT("identical", "same to the bit")}},
			   {"Memory, KiB",
			    "rows",
			    NULL,
			    {TEXT("name", "scene"), NUMBER("plan_memory_KiB", "plan", 3),
			     NUMBER("full_memory_KiB", "full pipeline's plan", 3),
			     NUMBER("memory_KiB", "memory", 4),
			     NUMBER("process_own_KiB", "process, its own", 6),
			     NUMBER("process_memory_KiB", "with shared libraries", 6),
			     NUMBER("libraries_mapped", "libraries", 3)}},
			   {"What is kept, and what is left out",
			    "rows",
			    NULL,
			    {TEXT("name", "scene"), TEXT("stages", "stages"),
			     TEXT("left_out", "left out"),
			     TEXT("libraries_not_mapped", "libraries not mapped"),
			     TEXT("devices", "devices"),
			     TEXT("files_open", "files open")}},
			   {"What is left out, why, and what it would cost",
			    "left_out",
			    NULL,
			    {TEXT("stage", "stage"), TEXT("why", "why"),
			     PART(ROWS, "", "scenes", 0),
			     PART(LARGEST, "ns", "ns per tick, neutral, at most", 2)}}},
	},
	{
		.word = "extremes",
		.program = "incise-bench",
		.title = "Extremes: what was tried, and what came out",
		.question =
			"Does any input, however extreme, yield NaN, an overflow, a force "
			"over the limit, or an endless loop?",
		.method =
			"Each door of the library is given numbers and bytes that nobody should "
			"send: the largest and smallest, NaN, infinities, files that are damaged. "
			"What comes out is held within its limits, refused with a reason, or wrong. "
			"Walls of 10 N/m to 1 GN/m are pressed for 12 s with a device of 50 g, in a "
			"whole plan and alone, with the guard of passivity and without, behind a "
			"limit of force; those that a scene would be refused for are forced.",
		.reference = "The limits that are stated; for walls the limit of theory.",
		.limits =
			"So many cases, and no proof; what is certified is said with the "
			"evaluator. Fuzzers try more: make check-fuzz.",
		.pictures =
			{{"", "Walls of 10 N/m to 1 GN/m: way, motion at the end, force.",
			  "Above the limit of theory motions do not end, and stay bounded "
			  "behind the limit of force."}},
		.tables = {{"What was tried",
			    "rows",
			    NULL,
			    {TEXT("name", "door"), TEXT("what", "with"),
			     NUMBER("tried", "tried", 9), NUMBER("held", "held", 9),
			     NUMBER("refused", "refused", 9),
			     NUMBER("wrong", "wrong", 9)}},
			   {"Stiff walls",
			    "stiff",
			    NULL,
			    {TEXT("path", "what"), TEXT("guard", "guard"),
			     TEXT("accepted", "accepted"), PART(ROWS, "", "walls", 0),
			     PART(RANGE, "K_N_m", "stiffness, N/m", 2),
			     PART(LEAST, "theory_limit_N_m", "limit of theory, N/m", 3),
			     PART(HOLDING, "bounded", "bounded", 0),
			     PART(LARGEST, "largest_N", "largest force, N", 3),
			     PART(LARGEST, "largest_mm", "largest way, mm", 3),
			     PART(LARGEST, "late_mm", "motion at the end, mm", 2),
			     PART(SUM, "not_finite", "not finite", 6),
			     PART(HOLDING, "failed", "failed", 0)}}},
	},
	{0},
};
