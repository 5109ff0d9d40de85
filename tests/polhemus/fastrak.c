// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The emulator as a program, in real time:
 *
 *   fastrak [--kind fastrak|liberty|patriot] [--stations 12] [--flip N] [--lose N] [--link PATH]
 *           [--tip CM] [--usb FOLDER]
 *
 * behind a pseudo terminal, which it prints as "ready tty:/dev/pts/5:115200" (of PATH, a link,
 * when that is given), or as a device of USB in a mounted FunctionFS. N are parts of a
 * million, of bytes and of records. On standard input: "unplug", "plug", "lost" (prints how
 * many records it did not send whole), "sent" (prints how many it was to send, and writes
 * to the EEPROM), "late N" (its periods end N µs later from now on), "flag x" (each record has
 * this error character from now on; "flag" alone: as before), "freeze" and "thaw" (records
 * repeat one pose).
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../clock.h"
#include "emulator.h"
#include "usb_function.h"

static struct emulator e;
static const char *link_path, *usb_folder;
static int master = -1;

static void say(const char *text)
{
	puts(text);
	fflush(stdout);
}

static int plug(void)
{
	char name[64], text[120];

	master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (master < 0 || grantpt(master) || unlockpt(master) ||
	    ptsname_r(master, name, sizeof(name)))
		return -1;
	if (link_path) {
		unlink(link_path);
		if (symlink(name, link_path))
			return -1;
	}
	snprintf(text, sizeof(text), "ready tty:%s:115200", link_path ? link_path : name);
	say(text);
	return 0;
}

static void unplug(void)
{
	if (master >= 0)
		close(master);
	master = -1;
	if (link_path)
		unlink(link_path);
	e.n_records = e.n_replies = 0;
}

/* false: it ended. */
static bool command(void)
{
	char line[80], text[80];
	size_t touched = 0;

	if (!fgets(line, sizeof(line), stdin))
		return false;
	for (size_t i = 0; i < e.n_sent; i++)
		touched += e.sent[i].touched;
	if (!strcmp(line, "unplug\n")) {
		unplug();
	} else if (!strcmp(line, "plug\n") && master < 0) {
		plug();
	} else if (!strncmp(line, "late ", 5)) {
		e.start_ns += atoi(line + 5) * INT64_C(1000);
	} else if (!strncmp(line, "flag", 4)) {
		e.flag = line[4] == ' ' ? line[5] : '\0';
	} else if (!strcmp(line, "freeze\n") || !strcmp(line, "thaw\n")) {
		e.frozen = *line == 'f';
		e.frozen_slot = 1; /* one without a flag */
	} else if (!strcmp(line, "lost\n")) {
		snprintf(text, sizeof(text), "lost %zu", touched);
		say(text);
	} else if (!strcmp(line, "sent\n")) {
		snprintf(text, sizeof(text), "sent %zu eeprom %d", e.n_sent,
			 e.eeprom_writes);
		say(text);
	}
	return true;
}

static void serve_tty(void)
{
	bool listen = true;

	for (;;) {
		struct pollfd waits[2] = {{.fd = master, .events = POLLIN},
					  {.fd = listen ? 0 : -1, .events = POLLIN}};
		char bytes[1024];
		ssize_t n = 0;
		size_t m;

		poll(waits, 2, 1);
		if (waits[1].revents)
			listen = command();
		/* It says so at once as long as nobody has the other end open. */
		if (waits[0].revents & POLLHUP)
			poll(NULL, 0, 1);
		if (master >= 0 && waits[0].revents & POLLIN && waits[0].fd == master)
			n = read(master, bytes, sizeof(bytes));
		emulator_advance(&e, now_ns());
		if (n > 0)
			emulator_write(&e, bytes, (size_t)n);
		/* Nobody reads: as on a wire without one. */
		while ((m = emulator_take(&e, bytes, sizeof(bytes))) > 0)
			if (master < 0 || write(master, bytes, m) < 0)
				break;
	}
}

static int usage(void)
{
	fputs("usage: fastrak [--kind fastrak|liberty|patriot] [--stations 12] [--flip N] "
	      "[--lose N] [--link PATH] [--tip CM] [--usb FOLDER]\n",
	      stderr);
	return 2;
}

int main(int argc, char **argv)
{
	enum emulator_kind kind = EMULATOR_FASTRAK;
	const char *stations = "1";
	struct emulator_damage damage = {.to = UINT64_MAX};
	double tip_cm = 0;

	for (int i = 1; i + 1 < argc; i += 2) {
		if (!strcmp(argv[i], "--kind"))
			kind = argv[i + 1][0] == 'l'   ? EMULATOR_LIBERTY
			       : argv[i + 1][0] == 'p' ? EMULATOR_PATRIOT
						       : EMULATOR_FASTRAK;
		else if (!strcmp(argv[i], "--stations"))
			stations = argv[i + 1];
		else if (!strcmp(argv[i], "--flip"))
			damage.flip = (unsigned int)atoi(argv[i + 1]);
		else if (!strcmp(argv[i], "--lose"))
			damage.lose = (unsigned int)atoi(argv[i + 1]);
		else if (!strcmp(argv[i], "--link"))
			link_path = argv[i + 1];
		else if (!strcmp(argv[i], "--tip"))
			tip_cm = atof(argv[i + 1]);
		else if (!strcmp(argv[i], "--usb"))
			usb_folder = argv[i + 1];
		else
			return usage();
	}
	if (argc % 2 == 0)
		return usage();
	/* poll() does not report lines that stdio has read ahead. */
	setvbuf(stdin, NULL, _IONBF, 0);
	emulator_init(&e, kind, now_ns());
	e.damage = damage;
	e.tip[0][0] = tip_cm;
	for (; *stations >= '1' && *stations <= '4'; stations++)
		e.present[*stations - '1'] = true;
	if (usb_folder)
		return usb_function(&e, usb_folder, command);
	if (plug()) {
		perror("fastrak");
		return 1;
	}
	serve_tty();
}
