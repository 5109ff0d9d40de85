// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A foot switch of the kernel's own making, by uinput: the library reads it, for itself alone, until
 * it is unplugged. For a loop it is pressed by words:
 *
 *   foot_switch         the tests of the library
 *   foot_switch pedal   prints its node; each line of standard input is a press, "c" of another
 *                       key; unplugged at the end of the input
 */
#include <errno.h>
#include <fcntl.h>
#include <linux/input.h>
#include <linux/uinput.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <incise/foot_switch.h>
#include "../tap.h"

/* The kernel makes the node, and a polled condition is met within this. */
#define PATIENCE_MS 10000

static int pedal = -1;

static void nap(int ms)
{
	poll(NULL, 0, ms);
}

static void send(int type, int code, int value)
{
	const struct input_event event = {
		.type = (__u16)type, .code = (__u16)code, .value = value};

	if (write(pedal, &event, sizeof(event)) != sizeof(event))
		abort();
}

static void press(int key)
{
	for (int value = 1; value >= 0; value--) {
		send(EV_KEY, key, value);
		send(EV_SYN, SYN_REPORT, 0);
	}
}

/* Its node: the only one of its name; devtmpfs makes it in /dev/input. */
static void plug_in(char node[256])
{
	struct uinput_setup setup = {.id = {.bustype = BUS_USB}, .name = "test pedal"};
	char name[64] = "";

	pedal = open("/dev/uinput", O_WRONLY | O_CLOEXEC);
	if (pedal < 0 || ioctl(pedal, UI_SET_EVBIT, EV_KEY) ||
	    ioctl(pedal, UI_SET_KEYBIT, KEY_B) || ioctl(pedal, UI_SET_KEYBIT, KEY_C) ||
	    ioctl(pedal, UI_DEV_SETUP, &setup) || ioctl(pedal, UI_DEV_CREATE)) {
		perror("uinput");
		exit(1);
	}
	for (int i = 0; i < 32; i++) {
		int fd;

		snprintf(node, 256, "/dev/input/event%d", i);
		fd = open(node, O_RDONLY | O_CLOEXEC);
		if (fd >= 0 && ioctl(fd, EVIOCGNAME(sizeof(name)), name) > 0 &&
		    !strcmp(name, setup.name)) {
			close(fd);
			return;
		}
		if (fd >= 0)
			close(fd);
	}
	fprintf(stderr, "the pedal has no node\n");
	exit(1);
}

static void unplug(void)
{
	ioctl(pedal, UI_DEV_DESTROY);
	close(pedal);
}

/* Presses until there are that many, or an error, or PATIENCE_MS have gone. */
static int presses_of(struct incise_foot_switch *foot, int wanted)
{
	int n = 0;

	for (int ms = 0; ms < PATIENCE_MS && n < wanted; ms++) {
		int rc = incise_foot_switch_read(foot);

		if (rc < 0)
			return rc;
		n += rc;
		nap(rc ? 0 : 1);
	}
	return n;
}

static void test_library(void)
{
	struct incise_foot_switch_setup setup = {.key = KEY_B}, other = {.key = KEY_D};
	struct incise_foot_switch *foot, *second;
	struct incise_error err = {0};
	struct input_event event;
	int seen, n;

	plug_in(setup.device);
	strcpy(other.device, setup.device);
	second = incise_foot_switch_open(&other, &err);
	check(!second && errno == ENXIO, "a device without the key is refused");
	strcpy(other.device, "/dev/null");
	second = incise_foot_switch_open(&other, &err);
	check(!second && errno == ENOTTY, "a device that is no input device is refused");
	seen = open(setup.device, O_RDONLY | O_NONBLOCK);
	send(EV_KEY, KEY_B, 1);
	send(EV_SYN, SYN_REPORT, 0);
	second = incise_foot_switch_open(&setup, &err);
	check(!second && errno == EBUSY, "one that is pressed is not taken");
	send(EV_KEY, KEY_B, 0);
	send(EV_SYN, SYN_REPORT, 0);
	while (read(seen, &event, sizeof(event)) > 0)
		continue;
	foot = incise_foot_switch_open(&setup, &err);
	check(foot, "it opens");
	if (!foot)
		return;
	second = incise_foot_switch_open(&setup, &err);
	check(!second && errno == EBUSY, "it is for one program");
	for (int i = 0; i < 5; i++)
		press(i == 2 ? KEY_C : KEY_B);
	n = presses_of(foot, 4);
	check(n == 4 && !incise_foot_switch_read(foot), "four presses are four");
	check(read(seen, &event, sizeof(event)) < 0, "nobody else sees them");
	/* More than the kernel keeps for a reader: what is left is whole. */
	for (int i = 0; i < 500; i++)
		press(KEY_B);
	n = presses_of(foot, 1);
	check(n > 0 && n < 500, "an overrun loses presses and makes none up");
	press(KEY_B);
	check(presses_of(foot, 1) == 1, "and the next press counts");
	unplug();
	check(presses_of(foot, 1) == -ENODEV, "unplugged");
	incise_foot_switch_close(foot);
	second = incise_foot_switch_open(&setup, &err);
	check(!second && errno == ENOENT, "and gone");
	close(seen);
}

int main(int argc, char **argv)
{
	char node[256], line[16];

	if (argc < 2 || strcmp(argv[1], "pedal")) {
		test_library();
		return tap_failures ? 1 : 0;
	}
	plug_in(node);
	printf("%s\n", node);
	fflush(stdout);
	while (fgets(line, sizeof(line), stdin))
		press(*line == 'c' ? KEY_C : KEY_B);
	unplug();
	return 0;
}
