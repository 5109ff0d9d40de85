// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Two administrators at one controller's folder in configfs: one makes it live and takes it
 * down, the other makes and removes a motor of it. Whoever comes first wins, the other is
 * reported; nothing is removed from below a live controller. First each order of the two in
 * turn, then both at once, where who comes first is chance: in virtual time it may always be
 * the same one.
 *
 *   stepper_folders FOLDER ROUNDS
 */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../tap.h"

static const char *folder;
static atomic_bool ended;

/* 0 or a negative errno. */
static int put(const char *file, const char *text)
{
	char path[256];
	int fd, rc = 0;

	snprintf(path, sizeof(path), "%s/%s", folder, file);
	fd = open(path, O_WRONLY | O_CLOEXEC);
	if (fd < 0)
		return -errno;
	if (write(fd, text, strlen(text)) < 0)
		rc = -errno;
	close(fd);
	return rc;
}

/* 0 or a negative errno. */
static int change_folder(int (*change)(const char *path), const char *name)
{
	char path[256];

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	return change(path) ? -errno : 0;
}

static int make(const char *path)
{
	return mkdir(path, 0755);
}

static void *make_and_remove(void *arg)
{
	(void)arg;
	while (!ended) {
		if (!change_folder(make, "motor1")) {
			put("motor1/step", "incise-sim:8");
			put("motor1/dir", "incise-sim:9");
		}
		change_folder(rmdir, "motor1");
	}
	return NULL;
}

static void try_each_order(void)
{
	check(!put("live", "1"), "it goes live with one motor");
	check(change_folder(make, "motor1") == -EBUSY, "while live no motor is added");
	check(change_folder(rmdir, "motor0") == -EBUSY, "while live its motor stays");
	check(put("motor0/step", "incise-sim:8") == -EBUSY,
	      "while live no line is changed");
	check(!put("live", "0"), "it goes down");
	check(!change_folder(make, "motor1"), "a motor is added");
	check(put("live", "1") == -ENXIO,
	      "with a motor without lines it does not go live");
	check(!put("motor1/step", "incise-sim:8") && !put("motor1/dir", "incise-sim:9"),
	      "the motor's lines");
	check(!put("live", "1"), "it goes live with two motors");
	check(change_folder(rmdir, "motor1") == -EBUSY,
	      "while live the other stays, too");
	check(!put("live", "0") && !change_folder(rmdir, "motor1"),
	      "it goes down, and the motor goes");
}

/* A page that is full to its last byte is neither taken nor shown beyond its end. */
static void try_long_label(void)
{
	char text[4096];

	memset(text, 'L', sizeof(text));
	memcpy(text + sizeof(text) - 14, ":5:active-low", 14);
	check(put("sync", text) == -ENAMETOOLONG, "a chip's label of 4 kB is refused");
}

int main(int argc, char **argv)
{
	int rounds = argc > 2 ? atoi(argv[2]) : 0, live = 0, unknown = 0;
	pthread_t other;

	if (argc < 3)
		return 2;
	folder = argv[1];
	try_long_label();
	try_each_order();
	if (!check(!pthread_create(&other, NULL, make_and_remove, NULL), "two at it"))
		return 1;
	for (int i = 0; i < rounds; i++) {
		int rc = put("live", "1");

		live += !rc;
		/* A motor that is being made, and one without its lines. */
		if (rc && rc != -EBUSY && rc != -ENXIO) {
			note("live: %s", strerror(-rc));
			unknown++;
		}
		put("live", "0");
	}
	ended = true;
	pthread_join(other, NULL);
	note("live %d times of %d", live, rounds);
	check(!unknown, "each time it goes live or is told why not");
	change_folder(rmdir, "motor1");
	check(!put("live", "1") && !put("live", "0"), "alone it always does");
	return tap_failures != 0;
}
