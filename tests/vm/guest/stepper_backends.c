// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * All cases of the conformance table on a real backend, over the simulated chip:
 *
 *   stepper_backends NAME RIG [CASE]
 *
 * Lines of the chip: step 0, dir 1, enable 2, limits 3 and 4, home 5, alarm 6, e-stop 7.
 * Behind them a carriage, whose home input is active up to step 40 and whose limit switch
 * at 0 is below 0. Prints "ok …" and "not ok …".
 */
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/backend.h>
#include <incise/rig.h>
#include "../../../driver/sim/incise_sim.h"
#include "../../unit/rig/conformance.h"

#define CARRIAGE                                                                      \
	"number=0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-1 max_at=1000000 " \
	"home_at=-2000..40 position=1500"

static bool good;

static void say(const char *text)
{
	good = false;
	printf("# %s\n", text);
}

static void tell_sim(const char *file, const char *text)
{
	char path[200];
	int fd;

	snprintf(path, sizeof(path), INCISE_SIM_DIR "/%s", file);
	fd = open(path, O_WRONLY | O_CLOEXEC);
	if (fd < 0 || write(fd, text, strlen(text)) != (ssize_t)strlen(text))
		say(path);
	if (fd >= 0)
		close(fd);
}

static void advance(void *world, int64_t ns)
{
	struct timespec wait = {ns / 1000000000, ns % 1000000000};

	(void)world;
	clock_nanosleep(CLOCK_MONOTONIC, 0, &wait, NULL);
}

static void input(void *world, unsigned int which, bool active)
{
	char text[16];

	(void)world;
	snprintf(text, sizeof(text), "%d %d", which == INCISE_STEPPER_LINE_ESTOP ? 7 : 4,
		 active);
	tell_sim("inputs", text);
}

static struct incise_rig *open_rig(const char *path)
{
	struct incise_error err = {0};
	struct incise_rig *rig = incise_rig_open(path, INCISE_RIG_STEPPER, &err);

	if (!rig)
		say(err.text);
	return rig;
}

/* The module's count goes on from one owner to the next: begin at 0. */
static void begin(const char *path)
{
	struct incise_rig *rig = open_rig(path);
	struct incise_stepper *stepper = rig ? incise_rig_stepper(rig) : NULL;
	struct incise_error err = {0};

	if (!rig)
		return;
	/* What the case before latched may be an e-stop that was released. */
	incise_stepper_clear(stepper, NULL);
	if (incise_stepper_enable(stepper, &err) ||
	    stepper->ops->origin(stepper, 0, false) ||
	    incise_stepper_disable(stepper, &err))
		say(err.text);
	incise_rig_close(rig);
	tell_sim("carriage", CARRIAGE);
}

static void run(int i, const char *name, const char *path)
{
	struct conformance c = {
		.advance = advance,
		.input = input,
		/* A thread under an emulated processor; the module needs none of it. */
		.slack_s = 0.3,
		.say = say,
	};
	struct incise_rig *rig;

	good = true;
	begin(path);
	rig = good ? open_rig(path) : NULL;
	if (rig) {
		c.stepper = incise_rig_stepper(rig);
		incise_stepper_info(c.stepper, &c.info);
		conformance[i].run(&c);
		incise_rig_close(rig);
	}
	printf("%sok %s: %s\n", good ? "" : "not ", name, conformance[i].name);
	fflush(stdout);
}

int main(int argc, char **argv)
{
	struct incise_stepper_info info;
	struct incise_rig *rig;

	if (argc < 3)
		return 2;
	good = true;
	tell_sim("inputs", "3 0\n4 0\n5 0\n6 0\n7 0");
	tell_sim("carriage", CARRIAGE);
	rig = open_rig(argv[2]);
	if (!rig) {
		printf("not ok %s: opens\n", argv[1]);
		return 1;
	}
	incise_stepper_info(incise_rig_stepper(rig), &info);
	printf("# %s: %s, up to %.0f steps/s\n", argv[1], info.name, info.rate_max_hz);
	incise_rig_close(rig);
	for (int i = 0; conformance[i].name; i++)
		if (argc < 4 || !strcmp(argv[3], conformance[i].name))
			run(i, argv[1], argv[2]);
	return 0;
}
