// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The simulated chip itself: edges, interrupts, mechanics, scripts, a full ring, garbage,
 * unbinding and unloading in use. Everything in the kernel's own terms, no library between.
 *
 *   sim_chip FILE-OF-incise_sim.ko
 */
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <string.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "../../clock.h"
#include "../simulator.h"
#include "../tap.h"

enum { step, dir, enable, min, max, home, estop, spare };

static struct incise_sim_edge edge[1 << 16];

/* Every edge that was made is there once, in order, timestamped by this clock. */
static void edges_are_whole(void)
{
	const unsigned int lines[] = {step, dir};
	const int n = 4000;
	int fd = lines_request(lines, 2, GPIO_V2_LINE_FLAG_OUTPUT);
	int64_t begin_ns, end_ns;
	bool right = true;
	long got;

	if (!check(fd >= 0, "two outputs are requested"))
		return;
	simulator_write("edges", "reset");
	begin_ns = now_ns();
	/* Of four calls one sets what is there: two bits of a Gray code and a pause. */
	for (int i = 0; i < n; i++)
		lines_set(fd, 1 << (i & 1), (i >> 1 & 1) ? 0 : 3);
	lines_set(fd, 1, 0);
	end_ns = now_ns();
	got = simulator_edges(edge, 1 << 16);
	check(got == n, "%d changes are %ld edges", n, got);
	for (long i = 0; i < got; i++)
		right &= edge[i].sequence == i && edge[i].line == (i & 1) &&
			 edge[i].value == !(i >> 1 & 1) && edge[i].flags == 0;
	check(right, "in the order in which they were made, none twice");
	right = got > 0 && edge[0].t_ns >= begin_ns && edge[got - 1].t_ns <= end_ns;
	for (long i = 1; i < got; i++)
		right &= edge[i].t_ns >= edge[i - 1].t_ns;
	check(right, "stamped in order, between the begin and the end of the calls");
	check(simulator_number("status", "repeats") == 1 &&
		      simulator_number("status", "lost") == 0,
	      "a level that was there already is counted, and no edge");
	close(fd);
}

/* The next event of a line, or 0 when none is there. */
static int event_of(int fd)
{
	struct pollfd wait = {.fd = fd, .events = POLLIN};
	struct gpio_v2_line_event event;

	/* It comes from a thread of the guest: half a minute is "never". */
	if (poll(&wait, 1, 30000) != 1 ||
	    read(fd, &event, sizeof(event)) != sizeof(event))
		return 0;
	return event.id;
}

static void interrupts_see_the_level(void)
{
	const unsigned int line = estop;
	const uint64_t input = GPIO_V2_LINE_FLAG_INPUT;
	bool right = true;
	int64_t before;
	int fd;

	fd = lines_request(&line, 1,
			   input | GPIO_V2_LINE_FLAG_EDGE_RISING |
				   GPIO_V2_LINE_FLAG_EDGE_FALLING);
	if (!check(fd >= 0, "an input with both edges is requested"))
		return;
	before = simulator_number("status", "interrupts");
	/* With both edges gpiolib reads the line to say which it was. */
	for (int i = 0; i < 100; i++) {
		simulator_write("inputs", "%u %d", line, !(i & 1));
		right &= event_of(fd) == (i & 1 ? GPIO_V2_LINE_EVENT_FALLING_EDGE
						: GPIO_V2_LINE_EVENT_RISING_EDGE);
	}
	check(right, "the interrupt's thread reads the level that raised it, 100 times");
	check(simulator_number("status", "interrupts") == before + 100,
	      "100 edges are 100 interrupts");
	simulator_write("inputs", "%u 0", line);
	check(simulator_number("status", "interrupts") == before + 100,
	      "the level that is there already is no interrupt");
	close(fd);

	fd = lines_request(&line, 1, input | GPIO_V2_LINE_FLAG_EDGE_FALLING);
	for (int i = 0; i < 5; i++) {
		simulator_write("inputs", "%u 1", line);
		simulator_write("inputs", "%u 0", line);
		right &= event_of(fd) == GPIO_V2_LINE_EVENT_FALLING_EDGE;
	}
	check(right && simulator_number("status", "interrupts") == before + 105,
	      "an input that asked for falling edges gets these only");
	close(fd);
	simulator_write("inputs", "%u 1\n%u 0", line, line + 1);
	simulator_write("inputs", "%u 0", line);
	check(simulator_number("status", "interrupts") == before + 105,
	      "a line that is given back interrupts no more");
}

/* One step of the carriage on lines step and dir (bits 0 and 1 of @fd). */
static void step_once(int fd, bool up)
{
	lines_set(fd, 2, up ? 2 : 0);
	lines_set(fd, 1, 1);
	lines_set(fd, 1, 0);
}

static void carriage_drives_limits(void)
{
	const unsigned int lines[] = {step, dir, enable};
	int fd = lines_request(lines, 3, GPIO_V2_LINE_FLAG_OUTPUT);
	bool right;
	long got;

	check(!simulator_write("carriage",
			       "step=%u dir=%u enable=%u min=%u max=%u home=%u min_at=-3 "
			       "max_at=5 home_at=0..2 position=0 inverted=enable,max",
			       step, dir, enable, min, max, home),
	      "a carriage is placed");
	simulator_write("edges", "reset");
	for (int i = 0; i < 5; i++)
		step_once(fd, true);
	check(simulator_number("carriage", "position") == 5 &&
		      simulator_number("carriage", "steps") == 5 &&
		      simulator_number("carriage", "highest") == 5,
	      "5 steps up are 5 steps up");
	got = simulator_edges(edge, 1 << 16);
	/* dir, 3 steps of two edges in which home ends, 2 more, max in the last. */
	right = got == 13;
	for (long i = 0; i < got && right; i++) {
		if (i == 6)
			right = edge[i].line == home && edge[i].value == 0 &&
				edge[i].flags == INCISE_SIM_EDGE_INPUT;
		else if (i == 11)
			right = edge[i].line == max && edge[i].value == 0 &&
				edge[i - 1].line == step && edge[i - 1].value == 1;
		else
			right = edge[i].line == (i ? step : dir);
	}
	check(right, "limit and home follow the very edge that reached them (%ld edges)",
	      got);
	for (int i = 0; i < 8; i++)
		step_once(fd, false);
	check(simulator_number("carriage", "position") == -3 &&
		      simulator_number("carriage", "lowest") == -3 &&
		      simulator_number("carriage", "down") == 8,
	      "8 steps down end at the lower limit");
	lines_set(fd, 4, 4);
	step_once(fd, true);
	check(simulator_number("carriage", "position") == -3 &&
		      simulator_number("carriage", "ignored") == 1,
	      "without enable, which is active low here, it does not move");
	close(fd);
	simulator_write("carriage", "off");
	check(simulator_number("carriage", "position") == INT64_MIN, "off removes it");
	simulator_write("inputs", "%u 0\n%u 0\n%u 0", min, max, home);
}

static void scripts_strike(void)
{
	const unsigned int lines[] = {step, dir};
	int fd = lines_request(lines, 2, GPIO_V2_LINE_FLAG_OUTPUT);
	long got, at;

	simulator_write("edges", "reset");
	check(!simulator_write("scripts", "after=3 line=%u edge=rising set=%u value=1",
			       step, estop) &&
		      !simulator_write("scripts", "after=1 line=%u set=%u value=1", estop,
				       spare),
	      "two scripts are taken, the second waits for the first");
	for (int i = 0; i < 5; i++)
		step_once(fd, true);
	got = simulator_edges(edge, 1 << 16);
	for (at = 0; at < got && edge[at].line != estop; at++)
		;
	/* dir, 2 steps of two edges, the third's rising edge */
	check(got == 13 && at == 6 && edge[at].value == 1 && edge[at + 1].line == spare,
	      "after the third rising edge, and in no other place (%ld of %ld)", at, got);
	check(simulator_number("scripts", "left") == 0,
	      "a script says that it has fired");
	simulator_write("scripts", "clear");
	check(simulator_number("scripts", "left") == INT64_MIN, "clear removes them");
	for (int i = 0; i < INCISE_SIM_SCRIPTS; i++)
		simulator_write("scripts", "after=9 line=%u set=%u value=0", step, estop);
	check(simulator_write("scripts", "after=9 line=%u set=%u value=0", step, estop) ==
		      -EBUSY,
	      "more than %d at once: EBUSY", INCISE_SIM_SCRIPTS);
	simulator_write("scripts", "clear");
	simulator_write("inputs", "%u 0\n%u 0", estop, spare);
	close(fd);
}

/* Refused with EINVAL, and nothing has changed. */
static void garbage_is_refused(void)
{
	static const struct {
		const char *file, *text;
	} garbage[] = {
		{"edges", "res"},
		{"edges", "reset reset"},
		{"edges", "\n"},
		{"inputs", "1"},
		{"inputs", "1 2"},
		{"inputs", "-1 1"},
		{"inputs", "64 1"},
		{"inputs", "99999999999999999999 1"},
		{"inputs", "1 1\n1 0"},
		{"inputs", "6 1\n7 x"},
		{"inputs", "0x1 1"},
		{"carriage", "step=0"},
		{"carriage", "step=0 dir=0"},
		{"carriage", "step=0 dir=1 min=1"},
		{"carriage", "step=0 dir=64"},
		{"carriage", "step=0 dir=1 min_at=a"},
		{"carriage", "step=0 dir=1 home_at=5"},
		{"carriage", "step=0 dir=1 home_at=5..4"},
		{"carriage", "step=0 dir=1 home_at=5..4..3"},
		{"carriage", "step=0 dir=1 inverted=sideways"},
		{"carriage", "step=0 dir=1 number=8"},
		{"carriage", "step=0 dir=1 number=-1"},
		{"carriage", "step=0 dir=1 position=9223372036854775807"},
		{"carriage", "step=0 dir=1 off"},
		{"carriage", "step=0 dir=1 whatever"},
		{"scripts", "after=0 line=0 set=1 value=1"},
		{"scripts", "after=1 line=0 set=1"},
		{"scripts", "after=1 line=0 set=1 value=2"},
		{"scripts", "after=1 after=1 line=0 set=1 value=1"},
		{"scripts", "after=1 line=0 set=1 value=1 edge=none"},
		{"scripts", "after=18446744073709551616 line=0 set=1 value=1"},
		{"scripts", "clear all"},
		{"adc/control", "replay"},
		{"adc/control", "once once"},
		{"adc/waveform", "odd"},
		{"adc/waveform", "\xff\xff"},
	};
	static const char *const files[] = {"edges",   "inputs",      "carriage",
					    "scripts", "adc/control", "adc/waveform"};
	static char big[100001];
	bool right = true;
	int ret;

	simulator_write("edges", "reset");
	for (size_t i = 0; i < sizeof(garbage) / sizeof(*garbage); i++) {
		ret = simulator_write(garbage[i].file, "%s", garbage[i].text);
		if (ret != -EINVAL)
			note("%s took \"%s\": %d", garbage[i].file, garbage[i].text, ret);
		right &= ret == -EINVAL;
	}
	memset(big, 0xa5, sizeof(big));
	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		right &= simulator_write_bytes(files[i], big, sizeof(big)) == -EINVAL &&
			 simulator_write_bytes(files[i], "off\0", 4) == -EINVAL;
	check(right, "garbage is refused with EINVAL");
	check(simulator_number("status", "edges") == 0 &&
		      simulator_number("carriage", "step") == INT64_MIN &&
		      simulator_number("scripts", "line") == INT64_MIN &&
		      simulator_number("adc/status", "queued") == 0,
	      "and nothing of it has come into force");
}

static void ring_overflows(const char *module)
{
	const unsigned int line = step;
	bool right = true;
	long got;
	int fd;

	check(module_load(module, "ring=15") == -EINVAL &&
		      module_load(module, "lines=0") == -EINVAL &&
		      module_load(module, "lines=257") == -EINVAL,
	      "parameters out of range: EINVAL");
	if (!check(!module_load(module, "ring=50 lines=4"),
		   "a ring of 50, a chip of 4 lines"))
		return;
	check(simulator_number("status", "ring") == 64 &&
		      simulator_number("status", "lines") == 4,
	      "50 is rounded up to 64");
	fd = lines_request(&line, 1, GPIO_V2_LINE_FLAG_OUTPUT);
	simulator_write("edges", "reset");
	for (int i = 0; i < 200; i++)
		lines_set(fd, 1, !(i & 1));
	check(simulator_number("status", "held") == 64 &&
		      simulator_number("status", "lost") == 136 &&
		      simulator_number("status", "edges") == 200,
	      "of 200 edges 64 are held and 136 lost");
	got = simulator_edges(edge, 1 << 16);
	for (long i = 0; i < got; i++)
		right &= edge[i].sequence == i;
	check(got == 64 && right, "what is read is whole up to the loss");
	lines_set(fd, 1, 1);
	got = simulator_edges(edge, 1 << 16);
	check(got == 1 && edge[0].sequence == 200,
	      "and the sequence shows the gap after it");
	close(fd);
	module_unload("incise_sim");
}

/* The platform bus's files: 0 or a negative errno. */
static int driver_write(const char *file)
{
	char path[128];
	int fd, ret = 0;

	snprintf(path, sizeof(path), "/sys/bus/platform/drivers/" INCISE_SIM_LABEL "/%s",
		 file);
	fd = open(path, O_WRONLY | O_CLOEXEC);
	if (fd < 0 || write(fd, INCISE_SIM_LABEL, strlen(INCISE_SIM_LABEL)) < 0)
		ret = -errno;
	close(fd);
	return ret;
}

/*
 * A line that is given back after its chip has gone still holds the chip's module there;
 * nothing but a reboot helps, and other tests want to load it again.
 */
static bool gpiolib_forgets(void)
{
	struct utsname name;
	int major = 0, minor = 0;

	uname(&name);
	sscanf(name.release, "%d.%d", &major, &minor);
	return major < 6 || (major == 6 && minor < 9);
}

static void leaves_in_peace(const char *module)
{
	const unsigned int line = step;
	int fd = lines_request(&line, 1, GPIO_V2_LINE_FLAG_OUTPUT);
	int ret = module_unload("incise_sim");

	check(ret == -EAGAIN || ret == -EBUSY,
	      "unloading while a line is requested is refused");
	check(!lines_set(fd, 1, 1), "and the line still works");
	close(fd);
	check(!driver_write("unbind") && access(INCISE_SIM_DIR, F_OK),
	      "unbinding takes the files away");
	check(!driver_write("bind") && simulator_number("status", "lines") == 64,
	      "binding brings them back");
	check(!module_unload("incise_sim"), "it unloads when nobody uses it");

	if (!check(!module_load(module, ""), "and loads again"))
		return;
	if (gpiolib_forgets()) {
		printf("ok unbinding in use # skip gpiolib before 6.9 never gives the module "
		       "back then\n");
		return;
	}
	fd = lines_request(&line, 1, GPIO_V2_LINE_FLAG_OUTPUT);
	driver_write("unbind");
	check(lines_set(fd, 1, 1) == -ENODEV, "a line whose chip is gone: ENODEV");
	close(fd);
	driver_write("bind");
	fd = lines_request(&line, 1, GPIO_V2_LINE_FLAG_OUTPUT);
	check(fd >= 0 && !lines_set(fd, 1, 1), "the chip works again after that");
	close(fd);
}

int main(int argc, char **argv)
{
	if (argc != 2 || module_load(argv[1], ""))
		return check(false, "incise_sim.ko loads"), 1;
	edges_are_whole();
	interrupts_see_the_level();
	carriage_drives_limits();
	scripts_strike();
	garbage_is_refused();
	check(!module_unload("incise_sim"), "incise_sim unloads");
	ring_overflows(argv[1]);
	if (!module_load(argv[1], ""))
		leaves_in_peace(argv[1]);
	check(!module_unload("incise_sim"), "incise_sim unloads at the end");
	return tap_failures != 0;
}
