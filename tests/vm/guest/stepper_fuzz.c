// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A hostile owner: a page of set-points that is written over at random while the motors
 * move, and ioctls of every number with random bytes, sizes and addresses, while another
 * process opens, closes, reads and maps. Nothing may move out of its limits, and after all
 * of it the module works. What the kernel says of it (an oops, a warning, lockdep, KASAN)
 * is looked at by tests/vm/boot.
 *
 *   stepper_fuzz ROUNDS SEED
 */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../bench.h"
#include "../draw.h"
#include "../tap.h"

#define MOTORS 2
#define PAGE 4096
#define ALL ((1U << MOTORS) - 1)

static struct bench bench;

static bool ready(void)
{
	int ret = 0;

	for (unsigned int i = 0; i < MOTORS && !ret; i++) {
		struct incise_stepper_config config = draw_config(&bench, i);

		config.jerk = 0;
		ret = bench_configure(&bench, &config, 0);
		ret = ret ? ret : bench_carriage(&config, 0, "");
	}
	if (ret)
		note("configure: %s", strerror(-ret));
	return !ret;
}

/* Bytes of the page, by every sort of dirt; @kind says which. */
static void dirty(int kind)
{
	volatile uint8_t *byte = (volatile uint8_t *)bench.setpoint;
	unsigned int motor = draw_between(0, MOTORS - 1);

	switch (kind) {
	case 0: /* anything anywhere */
		for (int i = 0; i < PAGE; i++)
			byte[i] = draw();
		break;
	case 1: /* a bit */
		byte[draw_between(0, MOTORS * 64 - 1)] ^= 1 << draw_between(0, 7);
		break;
	case 2: /* any target in a sound slot */
		bench_want(&bench, motor, draw_between(0, 1), draw());
		break;
	case 3: /* any mode */
		bench_want(&bench, motor, draw(), draw());
		break;
	case 4: /* writing for ever: seq stays odd */
		bench.setpoint[motor].seq |= 1;
		break;
	case 5: /* a torn slot: target changes without seq */
		bench.setpoint[motor].target = draw();
		break;
	default: /* sound again, so that something moves at all */
		for (int i = 0; i < PAGE; i++)
			byte[i] = 0;
		for (unsigned int i = 0; i < MOTORS; i++)
			bench_want(&bench, i, INCISE_STEPPER_MODE_POSITION,
				   draw_between(bench.config[i].position_min,
						bench.config[i].position_max));
	}
}

static void dirty_page(int rounds)
{
	uint64_t steps = 0, faults = 0;
	bool right = true, agree = true;

	for (int i = 0; i < rounds && right; i++) {
		right = ready() && !bench_command(&bench, INCISE_STEPPER_ENABLE, ALL);
		for (int k = 0; k < 60; k++) {
			dirty(k < 10 ? 6 : (int)draw_between(1, 12));
			bench_nap(draw_scattered(20000, 5000000));
		}
		dirty(0);
		bench_nap(3000000);
		for (unsigned int m = 0; m < MOTORS; m++)
			faults += bench_look(&bench, m).faults != 0;
		right &= bench_rest(&bench, MOTORS);
		bench_judge(&bench);
		for (unsigned int m = 0; m < MOTORS; m++)
			agree &= bench.log[m].position == bench_look(&bench, m).position;
		memset((void *)bench.setpoint, 0, PAGE);
	}
	for (unsigned int m = 0; m < MOTORS; m++)
		steps += bench.log[m].up + bench.log[m].down;
	note("%d pages of dirt: %" PRIu64 " steps, %" PRIu64 " faults", rounds, steps,
	     faults);
	check(right, "after any dirt the motors come to rest and work again");
	check(agree, "and every step was counted");
	check(steps > 0 && faults > 0, "there were motions, and faults, to speak of");
	check(!bench_faulty(&bench), "no edge breaks a promise, no position its limits");
}

/* One ioctl: mostly a true command with false contents, else anything. */
static int odd_ioctl(int fd)
{
	static uint64_t garbage[64];
	static const unsigned int sizes[] = {0, 4, 16, 64, 128, 256};
	unsigned long request = INCISE_STEPPER_IOC << 8 | draw_between(0, 9);
	void *argument = garbage;

	for (unsigned int i = 0; i < sizeof(garbage) / sizeof(*garbage); i++)
		garbage[i] = draw_between(0, 3) ? draw_between(0, 1000) : (int64_t)draw();
	/* Mostly zero behind the first fields, or nothing gets beyond the check of reserved. */
	if (draw_between(0, 2))
		memset(&garbage[draw_between(0, 20)], 0, 40 * sizeof(*garbage));
	switch (draw_between(0, 9)) {
	case 0:
		request = draw();
		break;
	case 1:
		request |= (unsigned long)(draw() & 0xffff) << 16;
		break;
	default:
		request |= (unsigned long)sizes[draw_between(0, 5)] << _IOC_SIZESHIFT;
		request |= (unsigned long)draw_between(0, 3) << _IOC_DIRSHIFT;
	}
	switch (draw_between(0, 19)) {
	case 0:
		argument = NULL;
		break;
	case 1:
		argument = (void *)(uintptr_t)draw();
		break;
	case 2: /* ends in the middle */
		argument = (char *)bench.status + PAGE - 8;
		break;
	}
	return ioctl(fd, request, argument) ? -errno : 0;
}

/* True commands with a motor's own config, some fields of it changed. */
static int near_ioctl(int fd)
{
	struct incise_stepper_config config =
		draw_config(&bench, draw_between(0, MOTORS - 1));
	uint8_t *byte = (uint8_t *)&config;

	for (int i = draw_between(0, 2); i > 0; i--)
		byte[draw_between(0, sizeof(config) - 1)] = draw();
	return ioctl(fd, INCISE_STEPPER_SET_CONFIG, &config) ? -errno : 0;
}

/* Another process, with doors of its own. */
static void visitor(uint64_t seed)
{
	static char events[4096];

	draw_seed(seed);
	for (;;) {
		int fd = open(bench.cdev, draw_between(0, 1) ? O_RDONLY | O_NONBLOCK
							     : O_RDWR | O_NONBLOCK);
		void *page;

		if (fd < 0)
			continue;
		for (int i = draw_between(0, 20); i > 0; i--) {
			struct pollfd wait = {.fd = fd, .events = POLLIN};
			ssize_t got = read(fd, events, draw_between(0, sizeof(events)));

			(void)got;
			poll(&wait, 1, draw_between(0, 1));
			odd_ioctl(fd);
			page = mmap(NULL, draw_between(0, 3) * PAGE, draw_between(0, 7),
				    draw_between(0, 1) ? MAP_SHARED : MAP_PRIVATE, fd,
				    draw_between(0, 3) * PAGE);
			if (page != MAP_FAILED)
				munmap(page, PAGE);
		}
		close(fd);
	}
}

static void odd_ioctls(int rounds)
{
	unsigned int taken = 0, unknown = 0, refused = 0;
	struct incise_stepper_controller before, after;
	uint64_t steps[2] = {0};
	bool strange = false;
	pid_t child;

	ioctl(bench.fd, INCISE_STEPPER_GET_INFO, &before);
	for (unsigned int m = 0; m < MOTORS; m++)
		steps[0] +=
			bench_look(&bench, m).steps_up + bench_look(&bench, m).steps_down;
	child = fork();
	if (!child) {
		visitor(draw());
		_exit(0);
	}
	for (int i = 0; i < rounds * 500; i++) {
		int ret = i % 4 ? odd_ioctl(bench.fd) : near_ioctl(bench.fd);

		taken += !ret;
		unknown += ret == -ENOTTY;
		refused += ret && ret != -ENOTTY;
		strange |= ret && ret != -ENOTTY && ret != -EINVAL && ret != -EFAULT &&
			   ret != -ERANGE && ret != -EBUSY && ret != -EPERM &&
			   ret != -EOPNOTSUPP && ret != -ENOTRECOVERABLE;
	}
	kill(child, SIGKILL);
	waitpid(child, NULL, 0);
	for (unsigned int m = 0; m < MOTORS; m++)
		steps[1] +=
			bench_look(&bench, m).steps_up + bench_look(&bench, m).steps_down;
	note("%u ioctls were taken, %u unknown, %u refused", taken, unknown, refused);
	check(taken && unknown && refused, "some of each sort");
	check(!strange, "refused with one of the errors that the ABI names");
	check(steps[0] == steps[1], "nobody has asked for a motion, and there is none");
	ioctl(bench.fd, INCISE_STEPPER_GET_INFO, &after);
	check(!memcmp(&before, &after, sizeof(before)),
	      "what the module is has not changed");
}

static void works(void)
{
	bool right;

	bench_rest(&bench, MOTORS);
	/* Whatever the steps were named in between. */
	simulator_write("edges", "reset");
	for (unsigned int m = 0; m < MOTORS; m++)
		bench.log[m].begun = false;
	right = ready() && !bench_command(&bench, INCISE_STEPPER_ENABLE, ALL);
	for (unsigned int m = 0; m < MOTORS && right; m++) {
		int64_t target = bench.config[m].position_max;

		for (unsigned int k = 0; k < MOTORS; k++)
			bench_want(&bench, k, INCISE_STEPPER_MODE_POSITION, 0);
		right &= bench_until(&bench, m, 1U << INCISE_STEPPER_STATE_READY,
				     INCISE_STEPPER_MODE_POSITION, target, 60000000000);
		bench_judge(&bench);
		right &= bench.log[m].position == target;
	}
	check(right && bench_rest(&bench, MOTORS),
	      "after all of it the motors go where they are told");
	check(!bench_faulty(&bench), "and no edge breaks a promise");
}

int main(int argc, char **argv)
{
	int rounds = argc > 1 ? atoi(argv[1]) : 10;
	int ret;

	draw_seed(argc > 2 ? strtoull(argv[2], NULL, 0) : 1);
	ret = bench_bind(&bench, MOTORS);
	ret = ret ? ret : bench_open(&bench);
	if (!check(!ret, "two motors are bound (%s)", strerror(-ret)))
		return 1;
	dirty_page(rounds);
	odd_ioctls(rounds);
	works();
	bench_close(&bench);
	check(!bench_unbind(&bench), "the motors are unbound");
	return tap_failures != 0;
}
