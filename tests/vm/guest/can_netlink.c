// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/socketcan_netlink.c on a controller of a real kernel, the kernel's slcan on
 * a pty whose other end only reads, compared with the output of ip. Prints "ok …" and "not ok …".
 *
 *   can_netlink ─ pty ─ N_SLCAN ─ can0 ◀─ ip link set … type can bitrate …
 */
#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>
#include <linux/can/netlink.h>
#include <linux/tty.h>
#include "../../../lib/device/can/bus/can_bus.h"
#include "../../../lib/device/can/bus/socketcan_netlink.h"
#include "../tap.h"

static int run(const char *format, const char *name)
{
	char command[200];

	snprintf(command, sizeof(command), format, name);
	return system(command);
}

/* Whether ip's details of the interface have these words. */
static bool ip_says(const char *name, const char *words)
{
	char command[200];

	snprintf(command, sizeof(command), "ip -details link show %s | grep -q '%s'",
		 name, words);
	return !system(command);
}

/* The controller that the line becomes; -1: it does not. */
static int attach(int *master, char name[IF_NAMESIZE])
{
	int discipline = N_SLCAN, line;
	char path[64];

	*master = posix_openpt(O_RDWR | O_NOCTTY);
	if (*master < 0 || grantpt(*master) || unlockpt(*master) ||
	    ptsname_r(*master, path, sizeof(path)))
		return -1;
	line = open(path, O_RDWR | O_NOCTTY);
	if (line < 0 || ioctl(line, TIOCSETD, &discipline) ||
	    ioctl(line, SIOCGIFNAME, name))
		return -1;
	return line;
}

static int open_bus(struct can_bus **bus, const char *name, uint32_t bitrate,
		    struct incise_error *err)
{
	const struct can_bus_request request = {
		.where = "rig.conf:1: stepper", .device = name, .bitrate = bitrate};

	return can_transport_socketcan.open(bus, &request, err);
}

static void as_ip_has_it(const char *name)
{
	struct incise_error err = {0};
	struct can_netlink link;
	struct can_bus *bus;

	check(!can_netlink_query(name, &link) && link.is_can && !link.is_up &&
		      !strcmp(link.kind, "can") &&
		      link.index == (int)if_nametoindex(name),
	      "a controller that is down is told of");
	check(open_bus(&bus, name, 0, &err) == -ENETDOWN &&
		      strstr(err.text, "up type can bitrate 1000000"),
	      "it is not opened: %s", err.text);
	check(!run("ip link set %s type can bitrate 500000", name) &&
		      !run("ip link set %s up", name),
	      "ip sets its rate");
	check(!can_netlink_query(name, &link) && link.is_up && link.bitrate == 500000 &&
		      ip_says(name, "bitrate 500000"),
	      "its rate is told as ip tells it");
	check(link.state == CAN_STATE_ERROR_ACTIVE && ip_says(name, "state ERROR-ACTIVE"),
	      "and its state");
	if (check(!open_bus(&bus, name, 500000, &err), "it is opened")) {
		check(bus->bitrate == 500000 &&
			      bus->ops->state(bus) == CAN_STATE_ERROR_ACTIVE,
		      "the bus has its rate and state");
		bus->ops->close(bus);
	}
	check(open_bus(&bus, name, 250000, &err) == -EINVAL &&
		      strstr(err.text, "runs at 500000 bit/s, but bitrate is 250000"),
	      "another rate is refused: %s", err.text);
	check(!run("ip link property add dev %s altname a-servo", name) &&
		      !can_netlink_query("a-servo", &link) && !strcmp(link.name, name),
	      "it is found by its other name, and tells its own");
}

/* An adapter that reads commands; else the kernel waits for that in vain. */
static pid_t adapter(int master)
{
	pid_t child = fork();
	char bytes[64];

	if (child)
		return child;
	while (read(master, bytes, sizeof(bytes)) > 0)
		;
	_exit(0);
}

int main(void)
{
	char name[IF_NAMESIZE] = "";
	struct can_netlink link;
	int master, line = attach(&master, name);
	pid_t child;

	if (line < 0) {
		check(false, "a line becomes a controller: %s", strerror(errno));
		return 0;
	}
	child = adapter(master);
	check(child > 0, "an adapter is there");
	as_ip_has_it(name);
	kill(child, SIGKILL);
	waitpid(child, NULL, 0);
	close(line);
	close(master);
	check(can_netlink_query(name, &link) == -ENODEV, "one that is away is not there");
	return 0;
}
