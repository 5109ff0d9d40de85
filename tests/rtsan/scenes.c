// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Every shipped scene in both evaluators through a cut and what can go wrong in it, in the
 * loop with its page of state and its control, under RealtimeSanitizer: it ends this program
 * at the first thing that no tick may do. What the ticks came to is counted, to show that
 * they went where they should.
 */
#include <errno.h>
#include <glob.h>
#include <math.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>
#include <incise/loop.h>
#include <incise/loop_control.h>
#include <incise/state.h>
#include "hands.h"

#define BEGIN 1000 /* ticks: in the middle of the cut */
#define END 1300

static bool is_now(void)
{
	return hands.reads >= BEGIN && hands.reads < END;
}

static int lost(struct incise_tracker_sample *samples, int n)
{
	(void)samples;
	return is_now() ? 0 : n;
}

static int wild(struct incise_tracker_sample *samples, int n)
{
	static const double what[] = {NAN, INFINITY, -1e300, 1e6, 1e-320};

	for (int i = 0; i < n && is_now(); i++)
		samples[i].position_mm[hands.reads % 3] = what[hands.reads % 5];
	return n;
}

static int gone(struct incise_tracker_sample *samples, int n)
{
	(void)samples;
	return hands.reads >= BEGIN ? -ENODEV : n;
}

static int stopped(struct incise_stepper_status *status, int rc)
{
	if (hands.reads < BEGIN)
		return rc;
	status->state = INCISE_STEPPER_STATE_FAULT;
	status->faults = INCISE_STEPPER_FAULT_ESTOP;
	return -EIO;
}

static int refused(int rc)
{
	return hands.reads < BEGIN ? rc : -EIO;
}

static const struct way {
	const char *name;
	unsigned int devices;
	int (*poses)(struct incise_tracker_sample *samples, int n);
	int (*status)(struct incise_stepper_status *status, int rc);
	int (*set)(int rc);
	int rc;	     /* of the loop */
	int flagged; /* seen in some tick: bit of incise_tick_flag, or 0 */
} ways[] = {
	{"a cut", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, NULL, NULL, NULL, 0,
	 INCISE_TICK_CONTACT},
	{"a cut without an actuator", INCISE_RIG_TRACKER, NULL, NULL, NULL, 0,
	 INCISE_TICK_CONTACT},
	{"a tracker that is lost and found", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER,
	 lost, NULL, NULL, 0, INCISE_TICK_STALE},
	{"poses that are none", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, wild, NULL, NULL,
	 0, 0},
	{"a tracker that went away", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, gone, NULL,
	 NULL, -ENODEV, INCISE_TICK_FAULT},
	{"an e-stop", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, NULL, stopped, NULL, -EIO,
	 INCISE_TICK_FAULT},
	{"a stepper that refuses", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, NULL, NULL,
	 refused, -EIO, INCISE_TICK_FAULT},
};

#define OFFERED_AT 700 /* ticks: another plan */
#define STOPPED_AT 2900

static struct seen {
	uint64_t runs, ticks, contacts, insertions, reloads, fades;
} seen;

static struct between {
	struct incise_loop_control *control;
	struct incise_plan *next; /* of the same scene */
	uint64_t ticks;
	volatile sig_atomic_t stop;
} between;

/*
 * Between ticks: what the hand holds, which takes effect out of the tissue; another plan; the
 * end.
 */
static int meddle(void *context, const struct incise_tick *tick)
{
	enum incise_tool tool = (enum incise_tool)(++between.ticks / 250 % 4);

	(void)context;
	seen.insertions += tick->phase == INCISE_PHASE_INSERTION;
	if (between.ticks % 250 == 0) {
		incise_plan_set_tool(hands.plan, tool);
		incise_plan_set_tool(between.next, tool);
	}
	if (between.ticks == OFFERED_AT)
		incise_loop_control_offer(between.control, between.next);
	between.stop = between.ticks >= STOPPED_AT;
	return 0;
}

static void run(const char *scene, const char *arithmetic, bool full,
		const struct way *way, const char *page)
{
	static struct incise_loop_stats stats;
	struct incise_loop_options options = {.duration_ns = 3 * INCISE_NS_PER_S,
					      .ticked = meddle,
					      .stop = &between.stop};
	struct incise_state_setup setup = {0};
	struct incise_error err = {0};
	int rc;

	hands_begin(scene, arithmetic, full, way->devices);
	hands.poses = way->poses;
	hands.status = way->status;
	hands.set = way->set;
	setup.rate_hz = options.rate_hz = incise_scene_rate_hz(hands.scene);
	options.state = incise_state_new(page, &setup, &err);
	between = (struct between){.control = incise_loop_control_new()};
	options.control = between.control;
	between.next = incise_plan_new(hands.scene, hands.rig, &err);
	if (!options.state || !between.control || !between.next)
		hands_fail(way->name, err.text);
	rc = incise_loop_run(hands.plan, incise_rig_clock(hands.rig), &options, &stats,
			     &err);
	if (rc != way->rc)
		hands_fail(way->name, rc ? err.text : "the loop did not end");
	if (way->flagged && !stats.flagged[__builtin_ctz((unsigned int)way->flagged)])
		hands_fail(way->name, "it made no difference to any tick");
	seen.runs++;
	seen.ticks += stats.ticks;
	seen.contacts += stats.flagged[__builtin_ctz(INCISE_TICK_CONTACT)];
	seen.reloads += !!incise_loop_control_retired(between.control);
	seen.fades += between.stop;
	incise_loop_control_free(between.control);
	incise_state_free(options.state);
	incise_plan_free(between.next);
	hands_end();
}

int main(void)
{
	static const char *const evaluators[] = {"fixed", "double"};
	char page[] = "/tmp/incise-rtsan-XXXXXX";
	glob_t scenes;
	int fd = mkstemp(page);

	if (fd < 0)
		hands_fail("state", "no place for a page");
	close(fd);
	if (glob("scenes/*.scene", 0, NULL, &scenes))
		hands_fail("scenes", "none here: run it in the project's folder");
	for (size_t s = 0; s < scenes.gl_pathc; s++)
		for (int a = 0; a < 4; a++)
			for (size_t w = 0; w < sizeof(ways) / sizeof(*ways); w++)
				run(scenes.gl_pathv[s], evaluators[a % 2], a > 1,
				    &ways[w], page);
	unlink(page);
	if (!seen.insertions)
		hands_fail("tools", "handle and tube were never in the tissue");
	if (!seen.reloads || !seen.fades)
		hands_fail("control", "no plan was changed, or no loop was stopped");
	printf("ok    rtsan: %zu scenes, %llu runs, %llu ticks, of them %llu in contact, "
	       "%llu of handle or tube; %llu plans changed, %llu loops stopped\n",
	       scenes.gl_pathc, (unsigned long long)seen.runs,
	       (unsigned long long)seen.ticks, (unsigned long long)seen.contacts,
	       (unsigned long long)seen.insertions, (unsigned long long)seen.reloads,
	       (unsigned long long)seen.fades);
	globfree(&scenes);
	return 0;
}
