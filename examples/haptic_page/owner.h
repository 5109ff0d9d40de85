/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The owner's side of a page for three axes, of ../openhaptics and ../forcedimension; without a
 * library of incise, for C and C++. doc/haptic-page.md has the rules.
 */
#ifndef HAPTIC_PAGE_OWNER_H
#define HAPTIC_PAGE_OWNER_H

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#include <incise/haptic_page.h>

struct owner {
	struct incise_haptic_page *page;
	char path[100];
	struct incise_haptic_page_owner half;
	struct incise_haptic_page_user user; /* last valid half */
	double share;			     /* of the user's force, 0 to 1 */
	int64_t forced_ns;		     /* time of the last owner_force() */
};

static int64_t now_ns(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

/* A page for "local:NAME"; the caller fills page->device next. 0, or -1 after a message. */
static int owner_begin(struct owner *owner, const char *name)
{
	struct flock lock;
	void *map;
	int fd;

	memset(owner, 0, sizeof(*owner));
	memset(&lock, 0, sizeof(lock));
	lock.l_type = F_WRLCK;
	lock.l_len = 1; /* the owner's byte */
	snprintf(owner->path, sizeof(owner->path), "/dev/shm/incise-%s", name);
	fd = open(owner->path, O_RDWR | O_NOFOLLOW);
	if (fd >= 0 && !fcntl(fd, F_OFD_SETLK, &lock))
		unlink(owner->path); /* that of a dead owner */
	fd = open(owner->path, O_RDWR | O_CREAT | O_EXCL, 0600);
	if (fd < 0 || fcntl(fd, F_OFD_SETLK, &lock) ||
	    ftruncate(fd, sizeof(*owner->page))) {
		perror(owner->path);
		return -1;
	}
	map = mmap(NULL, sizeof(*owner->page), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
	if (map == MAP_FAILED) {
		perror(owner->path);
		return -1;
	}
	owner->page = (struct incise_haptic_page *)map;
	owner->half.state = INCISE_HAPTIC_PAGE_READY;
	snprintf(owner->page->device.device, sizeof(owner->page->device.device),
		 "local:%s", name);
	return 0;
}

/* Put a sample of this moment, and show life; with the first one a user may attach. */
static void owner_sample(struct owner *owner, struct incise_haptic_page_sample *sample)
{
	sample->t_ns = owner->half.heartbeat_ns = now_ns();
	sample->sequence = sample->number = owner->half.samples++;
	incise_haptic_page_put(
		&owner->page->ring[sample->number % INCISE_HAPTIC_PAGE_RING], sample,
		sizeof(*sample));
	incise_haptic_page_put(&owner->page->owner, &owner->half, sizeof(owner->half));
	if (!sample->number)
		incise_haptic_page_publish(owner->page, (uint32_t)getpid());
}

/* Whether a half asks for a force that can be given. */
static int owner_accepts(const struct owner *owner,
			 const struct incise_haptic_page_user *next, int64_t now)
{
	return next->wants == INCISE_HAPTIC_PAGE_FORCE && next->period_ns > 0 &&
	       next->period_ns <= INCISE_HAPTIC_PAGE_PERIOD_NS &&
	       next->heartbeat_ns > 0 && next->heartbeat_ns <= now &&
	       isfinite(next->force_N[0]) && isfinite(next->force_N[1]) &&
	       isfinite(next->force_N[2]) && (int32_t)(next->seq - owner->user.seq) >= 0;
}

/*
 * The user's force now, at most @peak_N long: none without a heartbeat or a valid request, less while its half
 * is torn, then up by a ramp.
 */
static void owner_force(struct owner *owner, double peak_N, double force_N[3])
{
	struct incise_haptic_page_user next;
	int64_t now = now_ns();
	double ramp = (double)(now - owner->forced_ns) / INCISE_HAPTIC_PAGE_RAMP_NS;
	double length = 0, age;
	int whole = 0, i;

	for (i = 0; i < 3 && !whole; i++)
		whole = incise_haptic_page_get(&owner->page->user, &next, sizeof(next));
	/* One that stood still for 20 ms starts again. */
	owner->share = ramp > 0.2 ? 0 : fmin(1, owner->share + ramp);
	owner->forced_ns = now;
	if (whole && !owner_accepts(owner, &next, now))
		owner->share = 0;
	else if (whole)
		owner->user = next;
	age = owner->user.period_ns > 0 ? (double)(now - owner->user.heartbeat_ns) /
						  (double)owner->user.period_ns
					: 3;
	if (!whole)
		owner->share = fmin(owner->share, 2 - age);
	if (!(age <= 2))
		owner->share = 0;
	for (i = 0; i < 3; i++)
		length = hypot(length, owner->user.force_N[i]);
	for (i = 0; i < 3; i++)
		force_N[i] = owner->share > 0
				     ? owner->share * owner->user.force_N[i] *
					       (length > peak_N ? peak_N / length : 1)
				     : 0;
}

/* End with a reason; @state INCISE_HAPTIC_PAGE_ENDED or _FAILED. */
static void owner_end(struct owner *owner, uint32_t state, const char *reason)
{
	owner->half.state = state;
	snprintf(owner->half.reason, sizeof(owner->half.reason), "%s", reason);
	incise_haptic_page_put(&owner->page->owner, &owner->half, sizeof(owner->half));
	unlink(owner->path);
}

/* The quaternion, w first, of a rotation whose column k is where axis k points. */
static void quaternion_of(const double r[3][3], double q[4])
{
	int k = r[0][0] > r[1][1] ? 0 : 1, a, b, i;
	double size = 0;

	k = r[2][2] > r[k][k] ? 2 : k;
	a = (k + 1) % 3;
	b = (k + 2) % 3;
	if (r[0][0] + r[1][1] + r[2][2] > 0) {
		q[0] = 1 + r[0][0] + r[1][1] + r[2][2];
		for (i = 0; i < 3; i++)
			q[1 + i] =
				r[(i + 2) % 3][(i + 1) % 3] - r[(i + 1) % 3][(i + 2) % 3];
	} else {
		q[0] = r[b][a] - r[a][b];
		q[1 + k] = 1 + r[k][k] - r[a][a] - r[b][b];
		q[1 + a] = r[a][k] + r[k][a];
		q[1 + b] = r[b][k] + r[k][b];
	}
	for (i = 0; i < 4; i++)
		size = hypot(size, q[i]);
	for (i = 0; i < 4; i++)
		q[i] /= size;
}

#endif
