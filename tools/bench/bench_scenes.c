// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench scenes: a scene's plan, with the stages that it needs only, compared with the full
 * pipeline, which is the same scene with every stage kept and the needless ones neutral
 * (incise_scene_set_full()): time and memory of both, and whether their forces are the same to the bit.
 */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <jansson.h>
#include <incise/plan.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/file.h"
#include "../cli/json.h"
#include "../cli/mapped_libraries.h"
#include "../cli/scene_argument.h"
#include "bench.h"
#include "sheet.h"
#include "trajectory.h"

#define SCENES_MAX 64

/*
 * --- a loop's process: the cost of a haptic loop that no clock measures: the mappings, files and
 * memory of its process, from /proc ---
 */

/* incise haptic on the virtual rig for a moment of real time. */
struct loop_process {
	pid_t pid; /* 0: it has ended */
	struct memory_file report;
	json_t *libraries; /* names of shared objects that it mapped; NULL: not seen */
	json_t *files;	   /* those that it opened itself */
	json_t *devices;   /* of the rig, that its stages use */
	long peak_KiB;	   /* the most that it had in memory */
	long own_KiB;	   /* at the end, without what it shares with another process */
	char failed[200];
};

#define LOOK_US 20000

/* Long enough that it is looked at some times while it loops. */
#define RUN "0.4s"

/* Start the loop of a scene's file. */
static void loop_process_start(struct loop_process *process, const char *scene)
{
	char *program = cli_text("%s/incise-haptic", cli_folder());
	char *argv[] = {program, (char *)scene, "--rig", "sim:",   "--no-rt", "--state",
			"none",	 "--duration",	RUN,	 "--json", NULL};

	*process = (struct loop_process){.report = memory_file_begin("report")};
	process->pid = child_start(argv, fileno(process->report.file), -1);
}

/* A number of a file of /proc, in KiB: the sum of its lines with that word. */
static long number(pid_t pid, const char *file, const char *word)
{
	char line[256];
	long sum = 0;
	FILE *in;

	snprintf(line, sizeof(line), "/proc/%d/%s", (int)pid, file);
	in = fopen(line, "re");
	while (in && fgets(line, sizeof(line), in))
		if (!strncmp(line, word, strlen(word)))
			sum += atol(strchr(line, ':') ? strchr(line, ':') + 1 : "");
	if (in)
		fclose(in);
	return sum;
}

#define TARGET_BYTES 4096

/* Where a descriptor of a process leads; "" if it is not open. */
static void read_descriptor(pid_t pid, const char *name, char target[TARGET_BYTES])
{
	char path[320];
	ssize_t length;

	snprintf(path, sizeof(path), "/proc/%d/fd/%s", (int)pid, name);
	length = readlink(path, target, TARGET_BYTES - 1);
	target[length > 0 ? length : 0] = 0;
}

/* Beyond standard input and output, and the inherited ones, which we have too. */
static json_t *open_files(pid_t pid)
{
	json_t *list = json_array();
	char path[64], target[TARGET_BYTES], ours[TARGET_BYTES];
	struct dirent *entry;
	DIR *folder;

	snprintf(path, sizeof(path), "/proc/%d/fd", (int)pid);
	folder = opendir(path);
	while (folder && (entry = readdir(folder))) {
		if (atoi(entry->d_name) < 3)
			continue;
		read_descriptor(pid, entry->d_name, target);
		read_descriptor(getpid(), entry->d_name, ours);
		if (*target && strcmp(ours, target))
			json_array_append_new(list, json_text(target));
	}
	if (folder)
		closedir(folder);
	return list;
}

/* Look at a process while it is there; its libraries and files are gone before it. */
static void look_at_process(struct loop_process *process)
{
	json_t *libraries = mapped_libraries(process->pid);
	json_t *files = open_files(process->pid);
	long own_KiB = number(process->pid, "smaps_rollup", "Private_");
	/* Last: a process that has ended meanwhile has no memory. */
	long peak_KiB = number(process->pid, "status", "VmHWM");

	/* Before exec the process is the starter's copy, and has less. */
	if (!peak_KiB || !json_array_size(libraries) ||
	    json_array_size(libraries) < json_array_size(process->libraries)) {
		json_decref(libraries);
		json_decref(files);
		return;
	}
	json_decref(process->libraries);
	json_decref(process->files);
	process->libraries = libraries;
	process->files = files;
	process->peak_KiB = peak_KiB;
	process->own_KiB = own_KiB;
}

/* Read from its report which devices its stages use. */
static void take_report(struct loop_process *process)
{
	json_t *report, *stages, *stage;
	size_t i;

	rewind(process->report.file);
	report = json_loadf(process->report.file, 0, NULL);
	stages = json_object_get(report, "stages");
	if (stages)
		process->devices = json_array();
	else
		snprintf(process->failed, sizeof(process->failed),
			 "its loop gave no report");
	json_array_foreach(stages, i, stage)
	{
		if (!strcmp(json_string_value(stage), "pose"))
			json_array_append_new(process->devices, json_string("tracker"));
		else if (!strcmp(json_string_value(stage), "actuate"))
			json_array_append_new(process->devices, json_string("stepper"));
	}
	json_decref(report);
}

static void ended(struct loop_process *process, int status)
{
	process->pid = 0;
	if (!WIFEXITED(status) || WEXITSTATUS(status))
		snprintf(
			process->failed, sizeof(process->failed),
			"its loop fails on the simulated rig; run incise haptic to see the reason");
	else if (!process->libraries)
		snprintf(process->failed, sizeof(process->failed),
			 "its loop was not seen in /proc");
	else
		take_report(process);
}

/* Watch all of them until each has ended. */
static void loop_processes_watch(struct loop_process *const *processes, int n)
{
	int running, status;

	do {
		running = 0;
		for (int i = 0; i < n; i++) {
			struct loop_process *process = processes[i];

			if (!process->pid)
				continue;
			look_at_process(process);
			if (child_ended(process->pid, &status))
				ended(process, status);
			else
				running++;
		}
		usleep(LOOK_US);
	} while (running && !cli_stop);
	for (int i = 0; i < n; i++)
		if (processes[i]->pid)
			ended(processes[i], child_end(processes[i]->pid, 0));
}

/* --- scenes: those that are given, or those that ship and some that are made here --- */

/* A scene's own plan, or its full pipeline. */
struct variant {
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct walk walk;
	struct harness_time time; /* of a tick, ns */
	double memory_KiB;
};

struct scene {
	const char *name;
	const char *path; /* NULL: no such stage */
	bool kept;	  /* the full pipeline is its own */
	bool measured;	  /* its plans can be */
	struct variant few, full;
	struct trajectory trajectory; /* that is timed */
	long ticks_compared, ticks_in_contact;
	long first_difference; /* number of the tick; -1: no tick */
	double times_cheaper;
	struct loop_process process;
	int libraries_mapped; /* 0: not seen */
	/* Columns of the report; texts with ", " between names, or NULL. */
	json_t *stages, *left_out, *libraries, *not_mapped, *devices, *files;
	json_t *difference, *identical;
	char failed[520]; /* or "" */
};

struct scenes {
	struct scene scene[SCENES_MAX];
	int n;
};

static struct scene *add(struct scenes *s, const char *name, size_t length,
			 const char *path)
{
	struct scene *scene = &s->scene[s->n++];
	char *copy = cli_text("%.*s", (int)length, name);

	/* A file's name may be anyone's: it breaks no line. */
	for (char *c = copy; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	*scene = (struct scene){.name = copy, .path = path, .first_difference = -1};
	return scene;
}

static void add_given(struct scenes *s, const char *operand)
{
	struct scene_argument argument = {0};
	bool found = scene_argument_find(&argument, operand);

	add(s, operand, strlen(operand), found ? argument.path : NULL);
}

static void add_shipped(struct scenes *s)
{
	glob_t found;

	scene_argument_list_shipped(&found);
	for (size_t i = 0; i < found.gl_pathc && s->n < SCENES_MAX / 2; i++) {
		const char *name = strrchr(found.gl_pathv[i], '/') + 1;

		add(s, name, strlen(name) - strlen(".scene"), found.gl_pathv[i]);
	}
}

#define SPHERE                                                           \
	"surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, -50.0]; " \
	"radius_mm = 50.0; };\n"
#define DOUBLE "arithmetic = \"double\";\n"
#define REACTION "tissue = { reaction_N_mm = 0.14; };\n"
#define FORCES                                                                              \
	"tissue = { gain = 0.5; reaction_N_mm = 0.14; friction = 0.1; plane_N_mm = 0.17;\n" \
	"  damping_N_s_mm = 0.0005; insertion_N_mm = 0.28; aligned = 0.2;\n"                \
	"  spread_N_mm = 0.22; skin_friction = 0.1; fracture_J_m2 = 100.0; };\n"
/*
 * All that is no force: the membrane lies below the sphere's top and the sheet's waves, and is so small
 * that the depth below these hardly changes round it, as for one that lies aslant the limit is lower.
 */
#define EFFECTS                                                        \
	"effects = { average_ticks = 8; };\n"                          \
	"membrane = { point_mm = [0.0, 0.0, -6.0]; radius_mm = 0.2;\n" \
	"  thickness_mm = 5.0; puncture_N = 0.8; back_wall_mm = 14.0; };\n"
#define MESH "surface = { kind = \"mesh\"; file = \"%s\"; };\n"

/* From the plainest scene to a scene with all stages. */
static const struct {
	const char *name, *text; /* %s: a sheet of 20 000 triangles */
	bool all, kept;		 /* every force */
} made[] = {
	{"plane_reaction", DOUBLE REACTION, false, false},
	{"plane_kept", DOUBLE REACTION, false, true},
	{"plane_constraint",
	 DOUBLE "tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; };\n", false, false},
	{"sphere_all", DOUBLE SPHERE, true, false},
	{"sphere_all_fixed", "arithmetic = \"fixed\";\n" SPHERE, true, false},
	{"mesh_reaction", DOUBLE MESH REACTION, false, false},
	{"mesh_all", DOUBLE MESH, true, false},
};

/* As files in memory, which stay. */
static void add_made(struct scenes *s)
{
	for (int i = 0; i < N(made); i++) {
		struct memory_file *file = cli_alloc(2, sizeof(*file));

		file[0] = memory_file_begin(made[i].name);
		if (strchr(made[i].text, '%'))
			file[1] = sheet_of_waves(100, false);
		fprintf(file[0].file, made[i].text, file[1].path);
		if (made[i].all)
			fputs(FORCES EFFECTS, file[0].file);
		memory_file_written(&file[0]);
		add(s, made[i].name, strlen(made[i].name), file[0].path)->kept =
			made[i].kept;
	}
}

/* --- plans and forces --- */

/* Blade, handle and tube once each: the timed strokes. */
#define TIMED_STROKES 3
#define COMPARED_TICKS 120000
#define COMPARED_STROKES_MAX 1000 /* of a scene with few ticks a second */

/* Number of a stage of a plan; -1: no stage of that name. */
static int stage_of(const struct incise_plan *plan, const char *stage)
{
	const char *name;

	for (int i = 0; (name = incise_plan_stage(plan, i)); i++)
		if (!strcmp(name, stage))
			return i;
	return -1;
}

static bool open_variant(struct variant *v, const char *path, bool full,
			 struct incise_error *err)
{
	v->scene = incise_scene_load(path, NULL, err);
	if (!v->scene)
		return false;
	incise_scene_set_full(v->scene, full);
	v->plan = incise_plan_new(v->scene, NULL, err);
	if (v->plan)
		v->memory_KiB = (double)incise_plan_memory(v->plan) / 1024;
	return v->plan;
}

/* Kept, the stage of the tool changes nothing: there is only the blade. */
static bool inserts(const struct scene *s)
{
	return !s->kept && stage_of(s->few.plan, "tool") >= 0;
}

/* Make both plans, at the start of the trajectory that is timed. */
static void open_scene(struct scene *s)
{
	struct variant *variants[] = {&s->few, &s->full};
	struct incise_error err = {0};

	for (int i = 0; i < 2; i++)
		variants[i]->memory_KiB = NAN;
	if (!s->path) {
		snprintf(s->failed, sizeof(s->failed),
			 "no file and no scene of that name: %s", s->name);
		return;
	}
	if (!open_variant(&s->few, s->path, s->kept, &err) ||
	    !open_variant(&s->full, s->path, true, &err)) {
		snprintf(s->failed, sizeof(s->failed), "%s", err.text);
		return;
	}
	s->measured = true;
	trajectory_make(&s->trajectory, s->few.scene, s->few.plan, TIMED_STROKES,
			inserts(s), false);
	for (int i = 0; i < 2; i++)
		variants[i]->walk = (struct walk){.trajectory = &s->trajectory,
						  .plan = variants[i]->plan};
}

/* Run both over a long and varied trajectory, and compare the forces of each tick. */
static void compare(struct scene *s)
{
	struct walk *few = &s->few.walk, *full = &s->full.walk;
	int strokes = COMPARED_TICKS / (s->trajectory.ticks / s->trajectory.strokes) + 1;
	struct trajectory trajectory;

	if (strokes > COMPARED_STROKES_MAX)
		strokes = COMPARED_STROKES_MAX;
	trajectory_make(&trajectory, s->few.scene, few->plan, strokes, inserts(s), true);
	walk_change(few, &trajectory);
	walk_change(full, &trajectory);
	for (long i = 0; i < trajectory.ticks; i++) {
		struct incise_tick of_few, of_full;

		incise_plan_tick(few->plan, walk_feed(few), &of_few);
		incise_plan_tick(full->plan, walk_feed(full), &of_full);
		s->ticks_compared++;
		s->ticks_in_contact += !!(of_few.flags & INCISE_TICK_CONTACT);
		if (memcmp(of_few.command_N, of_full.command_N,
			   sizeof(of_few.command_N)) &&
		    s->first_difference < 0)
			s->first_difference = i;
	}
	walk_change(few, &s->trajectory);
	walk_change(full, &s->trajectory);
	free(trajectory.poses);
}

/* The loop has no way to keep stages that its scene does not need. */
static void watch_processes(struct scenes *s)
{
	struct loop_process *started[SCENES_MAX];
	int n = 0;

	for (int i = 0; i < s->n; i++)
		if (s->scene[i].measured && !s->scene[i].kept) {
			started[n] = &s->scene[i].process;
			loop_process_start(started[n++], s->scene[i].path);
		}
	loop_processes_watch(started, n);
	for (struct scene *scene = s->scene; scene < s->scene + s->n; scene++)
		if (*scene->process.failed)
			snprintf(scene->failed, sizeof(scene->failed), "%s",
				 scene->process.failed);
}

/* --- times --- */

#define TURNS 101
#define QUICK_TURNS 9

/* All of them in turns. */
static void time_all(struct scenes *s, bool quick)
{
	struct harness_variant variants[2 * SCENES_MAX];

	for (int i = 0; i < 2 * s->n; i++) {
		struct scene *scene = &s->scene[i / 2];
		struct variant *variant = i % 2 ? &scene->full : &scene->few;

		variants[i] = (struct harness_variant){
			.run = walk_run,
			.context = &variant->walk,
			.units = scene->measured ? scene->trajectory.ticks : 0,
			.time = &variant->time,
		};
	}
	harness_times(variants, 2 * s->n, quick ? QUICK_TURNS : TURNS);
	for (int i = 0; i < s->n; i++) {
		struct scene *scene = &s->scene[i];

		scene->times_cheaper =
			scene->full.time.ns.median / scene->few.time.ns.median;
	}
	cli_progress_end();
}

/* --- report --- */

static const struct bench_table table = {
	.key = "rows",
	.row_bytes = sizeof(struct scene),
	.columns =
		{
			COLUMN(scene, "name", name),
			COLUMN(scene, "stages", stages),
			COLUMN(scene, "left_out", left_out),
			COLUMN(scene, "libraries", libraries),
			COLUMN(scene, "tick_ns", few.time.ns.median),
			COLUMN(scene, "full_ns", full.time.ns.median),
			COLUMN(scene, "times_cheaper", times_cheaper),
			COLUMN(scene, "plan_memory_KiB", few.memory_KiB),
			COLUMN(scene, "process_memory_KiB", process.peak_KiB,
			       .optional = true),
			COLUMN(scene, "libraries_mapped", libraries_mapped,
			       .optional = true),
			COLUMN(scene, "libraries_not_mapped", not_mapped),
			COLUMN(scene, "devices", devices),
			COLUMN(scene, "files_open", files),
			COLUMN(scene, "full_memory_KiB", full.memory_KiB),
			COLUMN(scene, "process_own_KiB", process.own_KiB,
			       .optional = true),
			COLUMN(scene, "ticks_compared", ticks_compared),
			COLUMN(scene, "ticks_in_contact", ticks_in_contact),
			COLUMN(scene, "first_difference", difference),
			COLUMN(scene, "identical", identical),
			COLUMN(scene, "failed", failed),
			COLUMN(scene, "measured", measured, .data = true),
		},
	.metrics =
		{
			METRIC(TIME, scene, few.time, "ns", "{name} tick", "measured=1"),
			METRIC(TIME, scene, full.time, "ns", "{name} full tick",
			       "measured=1"),
		},
};

/* Names with ", " between them; NULL of no list. Takes the list. */
static json_t *joined(json_t *list)
{
	char text[8000] = "";
	const json_t *name;
	size_t i;

	if (!list)
		return NULL;
	json_array_foreach(list, i, name)
	{
		size_t n = strlen(text);

		snprintf(text + n, sizeof(text) - n, "%s%s", n ? ", " : "",
			 json_string_value(name));
	}
	json_decref(list);
	return json_string(text);
}

static json_t *stages_of(const struct incise_plan *plan)
{
	json_t *names = json_array();
	const char *name;

	for (int i = 0; (name = incise_plan_stage(plan, i)); i++)
		json_array_append_new(names, json_string(name));
	return joined(names);
}

static json_t *left_out_of(const struct incise_plan *plan)
{
	json_t *names = json_array();
	const char *name, *why;

	for (int i = 0; (name = incise_plan_left_out(plan, i, &why)); i++)
		json_array_append_new(names, json_string(name));
	return joined(names);
}

static void complete(struct scene *s)
{
	struct loop_process *process = &s->process;
	bool same = s->first_difference < 0;

	if (process->libraries) {
		s->libraries_mapped = (int)json_array_size(process->libraries);
		s->not_mapped = joined(unmapped_libraries(process->libraries));
	} else {
		process->peak_KiB = process->own_KiB = 0;
	}
	s->libraries = joined(process->libraries);
	s->devices = joined(process->devices);
	s->files = joined(process->files);
	if (!s->measured)
		return;
	s->identical = json_boolean(same);
	if (!same)
		s->difference = json_integer(s->first_difference);
	s->stages = stages_of(s->few.plan);
	s->left_out = left_out_of(s->few.plan);
}

static void judge(struct bench_run *run, const struct scenes *all)
{
	for (int i = 0; i < all->n; i++)
		if (all->scene[i].first_difference >= 0)
			bench_fail(
				run,
				"%s: a disabled stage changes the force, first in tick "
				"%ld: a fault of incise, please report it with the "
				"scene",
				all->scene[i].name, all->scene[i].first_difference);
	for (int i = 0; i < all->n && run->n_operands; i++)
		if (*all->scene[i].failed)
			bench_fail(run, "%s: not measured: %s", all->scene[i].name,
				   all->scene[i].failed);
}

static void run_scenes(struct bench_run *run)
{
	struct scenes *all = cli_alloc(1, sizeof(*all));

	for (int i = 0; i < run->n_operands; i++)
		add_given(all, run->operands[i]);
	if (!run->n_operands) {
		add_shipped(all);
		add_made(all);
	}
	for (int i = 0; i < all->n; i++)
		open_scene(&all->scene[i]);
	watch_processes(all);
	for (int i = 0; i < all->n && !cli_stop; i++) {
		cli_progress("%s: forces", all->scene[i].name);
		if (all->scene[i].measured)
			compare(&all->scene[i]);
	}
	time_all(all, run->quick);
	for (int i = 0; i < all->n; i++)
		complete(&all->scene[i]);
	bench_rows(run, &table, all->scene, all->n);
	judge(run, all);
}

const struct bench bench_scenes = {
	.name = "scenes",
	.operands = "[SCENE...]",
	.summary = "disabled stages of each scene, and the time saved",
	.n_operands = SCENES_MAX,
	.run = run_scenes,
};
