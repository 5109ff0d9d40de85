// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Whatever becomes of programs, the plan ticks in the kernel: a loop of SCHED_FIFO 80 that does
 * nothing but count its ticks runs beside it, as a scene's program would. It survives; it is no
 * stiffer for it: that is the tracker's to decide.
 *
 *   stepper_plan_survival
 */
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "../plan_feed.h"
#include "../tap.h"

#define TICK_NS 1000000
#define DEADMAN_NS 5000000000
#define LONG 60000000000

static struct bench bench;
static struct plan_feed *feed;
static pid_t feeder = -1, watcher = -1, scene = -1;
static const struct incise_fixed_plan_header *head;

/* The scene's loop: ticks that it missed, of as many as there should have been. */
static struct scene_loop {
	volatile uint64_t ticks, missed;
} * loop;

static void run_scene(void)
{
	int64_t next_ns = bench_now_ns();

	plan_fifo(80);
	for (;;) {
		int64_t late = bench_now_ns() - next_ns;

		if (late >= TICK_NS) {
			loop->missed += (uint64_t)(late / TICK_NS);
			next_ns += late / TICK_NS * TICK_NS;
		}
		loop->ticks++;
		next_ns += TICK_NS;
		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME,
				&(struct timespec){.tv_sec = next_ns / 1000000000,
						   .tv_nsec = next_ns % 1000000000},
				NULL);
	}
}

static void scene_begins(void)
{
	scene = fork();
	if (!scene) {
		run_scene();
		_exit(0);
	}
}

static void stop_for(pid_t pid, int64_t ns)
{
	kill(pid, SIGSTOP);
	bench_nap(ns);
	kill(pid, SIGCONT);
	bench_nap(10000000);
}

static void nothing(void)
{
	bench_nap(1000000000);
}

static void scene_stops(void)
{
	stop_for(scene, 2000000000);
}

static void scene_dies(void)
{
	int64_t began_ns = bench_now_ns();

	plan_kill(&scene);
	bench_nap(2000000000);
	/* A loop that is gone misses all. */
	loop->missed += (uint64_t)((bench_now_ns() - began_ns) / TICK_NS);
	scene_begins();
}

static void hog(void)
{
	pid_t pid = fork();

	if (!pid) {
		int64_t end_ns;

		plan_fifo(90);
		end_ns = bench_now_ns() + 300000000;
		while (bench_now_ns() < end_ns)
			;
		_exit(0);
	}
	waitpid(pid, NULL, 0);
	bench_nap(50000000);
}

static void memory_is_short(void)
{
	pid_t pid = bench_take_memory();

	plan_kill(&pid);
	bench_nap(50000000);
}

static void feeder_stops(void)
{
	stop_for(feeder, 1000000000);
}

static const struct event {
	const char *name;
	void (*act)(void);
	bool fades; /* no poses come meanwhile */
} events[] = {
	{"nothing, 1 s", nothing, false},
	{"scene stopped, 2 s", scene_stops, false},
	{"scene killed, 2 s", scene_dies, false},
	{"hog of FIFO 90, 0.3 s", hog, true},
	{"90 % of memory taken", memory_is_short, false},
	{"feeder stopped, 1 s", feeder_stops, true},
};

static void judge(const struct event *event, uint64_t missed, uint64_t loop_missed,
		  uint64_t ticks)
{
	int64_t bound = incise_fixed_plan_fade_ns(&head->numbers);

	note("%-24s %6llu %8llu %8llu %8.3f %9.3f %8.1f", event->name,
	     (unsigned long long)ticks, (unsigned long long)missed,
	     (unsigned long long)loop_missed, feed->steepest / 65536.0,
	     feed->force_min / 65536.0, feed->quiet_age_ns / 1e6);
	check(!missed, "%s: the kernel missed no tick", event->name);
	check(feed->steepest <= head->numbers.slew,
	      "%s: no tick changes the force by more than the slew", event->name);
	if (event->fades) {
		check(feed->reasons & INCISE_STEPPER_PLAN_SILENT &&
			      feed->states & 1U << INCISE_STEPPER_PLAN_FADE,
		      "%s: without poses the force fades, for the reason SILENT",
		      event->name);
		check(feed->quiet_age_ns > 0 && feed->quiet_age_ns <= bound,
		      "%s: it is gone when a pose is %.0f ms old", event->name,
		      bound / 1e6);
	} else {
		check(feed->force_min > 0 &&
			      !(feed->states & 1U << INCISE_STEPPER_PLAN_FADE),
		      "%s: the force stays", event->name);
	}
	check(plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG),
	      "%s: it is felt after it", event->name);
}

static void all_events(void)
{
	note("%-24s %6s %8s %8s %8s %9s %8s", "", "ticks", "missed", "by loop", "N/tick",
	     "least N", "0 at ms");
	for (unsigned int i = 0; i < sizeof(events) / sizeof(*events); i++) {
		struct incise_stepper_plan_status before, after;
		uint64_t loop_missed = loop->missed;

		bench_nap(100000000);
		if (!check(plan_watch_reset(feed), "%s: it is watched", events[i].name))
			return;
		before = plan_look(&bench);
		events[i].act();
		bench_nap(5000000);
		after = plan_look(&bench);
		judge(&events[i], after.missed - before.missed,
		      loop->missed - loop_missed, after.ticks - before.ticks);
	}
}

int main(void)
{
	const struct plan_recipe recipe = {"pressed", INCISE_FIXED_PLANE, 1, TICK_NS,
					   .plain = true};
	struct incise_stepper_config config;
	uint32_t size = 0;
	int ret;

	head = plan_make(&recipe, &size);
	feed = plan_feed_new();
	loop = mmap(NULL, sizeof(*loop), PROT_READ | PROT_WRITE,
		    MAP_SHARED | MAP_ANONYMOUS, -1, 0);
	ret = bench_bind(&bench, 1);
	ret = ret ? ret : bench_open(&bench);
	if (!check(head && feed && loop != MAP_FAILED && !ret, "a motor is bound (%s)",
		   strerror(-ret)))
		return 1;
	plan_fifo(99);
	config = plan_config(&bench, 0, TICK_NS, DEADMAN_NS);
	ret = bench_configure(&bench, &config, 750);
	ret = ret ? ret : plan_load(&bench, head, size, 1);
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	feed->depth_um = -2000;
	feed->tool = INCISE_TOOL_BLADE;
	watcher = plan_watcher(&bench, feed, 1);
	feeder = plan_feeder(&bench, feed);
	scene_begins();
	if (check(!ret && plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG),
		  "a plan runs (%s)", strerror(-ret))) {
		feed->depth_um = 2000;
		bench_nap(200000000);
		all_events();
	}
	plan_kill(&scene);
	plan_kill(&feeder);
	plan_kill(&watcher);
	bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
	bench_close(&bench);
	check(!bench_unbind(&bench), "it is unbound");
	return tap_failures != 0;
}
