// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Two administrators at one controller's folder in configfs: one makes it live and takes it
 * down, the other makes and removes a motor of it. Whoever comes first wins, the other is
 * reported; nothing is removed from below a live controller.
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

static void *make_and_remove(void *arg)
{
	char path[256];

	(void)arg;
	snprintf(path, sizeof(path), "%s/motor1", folder);
	while (!ended) {
		if (!mkdir(path, 0755)) {
			put("motor1/step", "incise-sim:8");
			put("motor1/dir", "incise-sim:9");
		}
		rmdir(path);
	}
	return NULL;
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
	int rounds = argc > 2 ? atoi(argv[2]) : 0, live = 0;
	pthread_t other;

	if (argc < 3)
		return 2;
	folder = argv[1];
	try_long_label();
	if (!check(!pthread_create(&other, NULL, make_and_remove, NULL), "two at it"))
		return 1;
	for (int i = 0; i < rounds; i++) {
		live += !put("live", "1");
		put("live", "0");
	}
	ended = true;
	pthread_join(other, NULL);
	note("live %d times of %d", live, rounds);
	check(live > 0, "now and then it goes live");
	check(!put("live", "1") && !put("live", "0"), "alone it always does");
	return tap_failures != 0;
}
