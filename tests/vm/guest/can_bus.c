// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/socketcan.c on a real kernel, over a vcan that is there and up:
 *
 *   can_bus INTERFACE
 *
 * which it takes down and deletes at the end. Prints "ok …" and "not ok …".
 */
#include <errno.h>
#include <net/if.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include "../../../lib/device/can/bus/can_bus.h"
#include "../tap.h"

#define MS INT64_C(1000000)
#define FLOOD 2000 /* a socket's queue holds a few hundred */

static const char *name;

/* Another program on the bus. */
static int peer_open(void)
{
	struct sockaddr_can address = {.can_family = AF_CAN};
	int fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);

	address.can_ifindex = (int)if_nametoindex(name);
	if (fd < 0 || bind(fd, (struct sockaddr *)&address, sizeof(address)))
		return -1;
	return fd;
}

static bool say(int peer, canid_t id, uint8_t bytes)
{
	struct can_frame frame = {.can_id = id, .can_dlc = bytes};

	return write(peer, &frame, sizeof(frame)) == sizeof(frame);
}

static int open_bus(struct can_bus **bus, const char *device, uint8_t node,
		    uint32_t bitrate, struct incise_error *err)
{
	const struct can_bus_request request = {.where = "rig.conf:1: stepper",
						.device = device,
						.bitrate = bitrate,
						.node = node};

	return can_transport_socketcan.open(bus, &request, err);
}

/* The next frame; what is on a vcan is there when write() came back. */
static int next(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns)
{
	int rc = bus->ops->receive(bus, frame, t_ns);

	if (rc)
		return rc;
	rc = bus->ops->wait(bus, bus->ops->now(bus) + 100 * MS);
	return rc ? rc : bus->ops->receive(bus, frame, t_ns);
}

static int count(struct can_bus *bus)
{
	struct can_frame frame;
	int64_t t_ns;
	int n = 0;

	while (next(bus, &frame, &t_ns) == 1)
		n++;
	return n;
}

static void say_all(int peer)
{
	say(peer, 0x190, 0);
	say(peer, 0x191, 0);
	say(peer, 0x190 | CAN_EFF_FLAG, 0);
	say(peer, 0x190 | CAN_RTR_FLAG, 0);
	say(peer, 0x710, 1);
	say(peer, CAN_EFF_MASK | CAN_EFF_FLAG, 8);
}

static void refusals(void)
{
	static const struct {
		const char *device;
		int code;
		const char *words;
	} cases[] = {
		{"lo", -EINVAL, "lo is not a CAN interface"},
		{"nope0", -ENODEV, "no such interface nope0"},
		{"a-name-that-is-far-too-long", -ENODEV, "no such interface a-name"},
		{"vcan9", -ENETDOWN, "vcan9 is down: ip link set vcan9 up"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct can_bus *bus;
		int rc = open_bus(&bus, cases[i].device, 0, 0, &err);

		if (!check(rc == cases[i].code && strstr(err.text, cases[i].words),
			   "%s is refused in words", cases[i].device))
			note("%d: %s", rc, err.text);
	}
}

static void filters(struct can_bus *bus, int peer)
{
	const canid_t mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
	const struct can_filter exact[] = {{0x190, mask}, {0x710, mask}};
	struct can_frame first = {0}, second = {0};
	int64_t t_ns;

	bus->ops->filter(bus, exact, 2);
	say_all(peer);
	check(next(bus, &first, &t_ns) == 1 && next(bus, &second, &t_ns) == 1 &&
		      first.can_id == 0x190 && second.can_id == 0x710 && !count(bus),
	      "exact filters let through what they name, and no more");
	bus->ops->filter(bus, NULL, 0);
	say_all(peer);
	check(count(bus) == 6, "no filter lets all through");
}

static void errors(struct can_bus *bus, int peer)
{
	const struct can_filter none = {0x001, CAN_SFF_MASK};
	uint64_t received = bus->counts.received;
	struct can_frame frame = {0};
	int64_t t_ns;

	bus->ops->filter(bus, &none, 1);
	say(peer, CAN_ERR_FLAG | CAN_ERR_BUSOFF, CAN_ERR_DLC);
	check(next(bus, &frame, &t_ns) == 1 &&
		      frame.can_id == (CAN_ERR_FLAG | CAN_ERR_BUSOFF) &&
		      bus->counts.errors == 1 && bus->counts.received == received,
	      "an error frame passes every filter, and is counted as one");
	frame.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
	check(bus->ops->send(bus, &frame) == -EINVAL, "an error frame is not sent");
	bus->ops->filter(bus, NULL, 0);
}

static void timestamps(struct can_bus *bus, int peer)
{
	struct can_frame frame;
	int64_t before, after, last = 0, t_ns = 0;
	bool good = true;

	for (int i = 0; i < 100; i++) {
		before = bus->ops->now(bus);
		good &= say(peer, 0x123, 8);
		after = bus->ops->now(bus);
		/* It lies there for a while: its timestamp is that of when it came. */
		bus->ops->wait(bus, after + MS);
		usleep(1000);
		good &= next(bus, &frame, &t_ns) == 1;
		/* Both clocks are read one after the other: as far apart as an interrupt
		 * between takes, some 7 µs here; a frame that is timestamped when it is read is
		 * a millisecond late. */
		good &= t_ns >= last && t_ns <= bus->ops->now(bus);
		good &= (t_ns >= before - 20000 && t_ns <= after + MS / 2) ||
			strcmp(getenv("INCISE_VM_PROFILE") ?: "", "deterministic");
		last = t_ns;
	}
	check(good, "stamps are of when a frame came");
}

static void overflow(struct can_bus *bus, int peer)
{
	uint64_t before = bus->counts.received, lost = bus->counts.overflow;
	int sent = 0;

	for (int i = 0; i < FLOOD; i++)
		sent += say(peer, 0x123, 8);
	count(bus);
	/* The next frame reports the loss. */
	sent += say(peer, 0x123, 8);
	count(bus);
	before = bus->counts.received - before;
	lost = bus->counts.overflow - lost;
	note("%d sent, %llu read, %llu lost", sent, (unsigned long long)before,
	     (unsigned long long)lost);
	check(lost > 0 && before + lost == (uint64_t)sent,
	      "each frame that nobody read in time is counted");
}

static void owners(void)
{
	struct incise_error err = {0};
	struct can_bus *bus;
	int ready[2], rc;
	char byte;
	pid_t owner;

	if (pipe(ready))
		return;
	owner = fork();
	if (!owner) {
		rc = open_bus(&bus, name, 16, 0, &err);
		byte = rc ? 'n' : 'y';
		if (write(ready[1], &byte, 1) == 1)
			pause();
		_exit(1);
	}
	check(read(ready[0], &byte, 1) == 1 && byte == 'y', "one program drives node 16");
	rc = open_bus(&bus, name, 16, 0, &err);
	if (!check(rc == -EBUSY && strstr(err.text, "another program drives it"),
		   "a second one is refused"))
		note("%d: %s", rc, err.text);
	rc = open_bus(&bus, name, 17, 0, &err);
	if (check(!rc, "another node is free"))
		bus->ops->close(bus);
	rc = open_bus(&bus, name, 0, 0, &err);
	if (check(!rc, "to look is free"))
		bus->ops->close(bus);
	kill(owner, SIGKILL);
	waitpid(owner, NULL, 0);
	rc = open_bus(&bus, name, 16, 0, &err);
	if (check(!rc, "after kill -9 the node is free"))
		bus->ops->close(bus);
}

static void set_up(bool up)
{
	struct ifreq ask = {0};
	int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);

	strncpy(ask.ifr_name, name, sizeof(ask.ifr_name) - 1);
	if (fd < 0 || ioctl(fd, SIOCGIFFLAGS, &ask))
		return;
	ask.ifr_flags = (short)(up ? ask.ifr_flags | IFF_UP : ask.ifr_flags & ~IFF_UP);
	ioctl(fd, SIOCSIFFLAGS, &ask);
	close(fd);
}

static bool all_say(struct can_bus *bus, int code)
{
	struct can_frame frame = {.can_id = 0x080};
	int64_t t_ns;

	return bus->ops->receive(bus, &frame, &t_ns) == code &&
	       bus->ops->send(bus, &frame) == code &&
	       bus->ops->wait(bus, INT64_MAX) == code &&
	       bus->ops->receive(bus, &frame, &t_ns) == code;
}

static void down_and_away(void)
{
	struct can_bus *bus, *sender;
	const struct can_frame sync = {.can_id = 0x080};
	struct incise_error err = {0};
	char command[64];

	if (!check(!open_bus(&bus, name, 16, 0, &err) &&
			   !open_bus(&sender, name, 0, 0, &err),
		   "it is opened again"))
		return;
	set_up(false);
	check(!bus->ops->wait(bus, INT64_MAX),
	      "waiting ends when the interface goes down");
	check(all_say(bus, -ENETDOWN), "all calls say that it is down");
	check(sender->ops->send(sender, &sync) == -ENETDOWN,
	      "so does the first one, a send");
	set_up(true);
	check(all_say(bus, -ENETDOWN), "it stays down for this bus");
	bus->ops->close(bus);
	sender->ops->close(sender);
	if (!check(!open_bus(&bus, name, 16, 0, &err) &&
			   !open_bus(&sender, name, 0, 0, &err),
		   "up again, it can be opened"))
		return;
	check(!bus->ops->send(bus, &sync), "and carries frames");
	snprintf(command, sizeof(command), "ip link del %s", name);
	check(!system(command), "the interface is deleted");
	check(all_say(bus, -ENODEV), "all calls say that it is away");
	check(sender->ops->send(sender, &sync) == -ENODEV,
	      "so does the first one, a send");
	bus->ops->close(bus);
	sender->ops->close(sender);
}

int main(int argc, char **argv)
{
	struct can_frame frame = {.can_id = 0x210, .can_dlc = 2, .data = {1, 2}},
			 seen = {0};
	struct incise_error err = {0};
	struct can_bus *bus;
	int peer, rc;

	if (argc != 2)
		return 2;
	name = argv[1];
	refusals();
	peer = peer_open();
	rc = open_bus(&bus, name, 0, 500000, &err);
	if (!check(peer >= 0 && !rc, "a bus opens on %s", name)) {
		note("%s", err.text);
		return 0;
	}
	check(!bus->bitrate && bus->ops->state(bus) == -EOPNOTSUPP,
	      "it has no bit rate and no state");
	check(!bus->ops->send(bus, &frame) &&
		      read(peer, &seen, sizeof(seen)) == sizeof(seen) &&
		      !memcmp(&frame, &seen, sizeof(frame)) && !count(bus),
	      "a frame that is sent arrives at others, and not at home");
	filters(bus, peer);
	errors(bus, peer);
	timestamps(bus, peer);
	overflow(bus, peer);
	bus->ops->close(bus);
	owners();
	down_and_away();
	close(peer);
	return 0;
}
