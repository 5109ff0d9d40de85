// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * device NAME: a haptic device of one's own, here 0.1 kg on a spring along x in software, for
 * `--rig local:NAME`; without a library of incise. doc/haptic-page.md has the rules.
 */
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#include <incise/haptic_page.h>

#define PERIOD_NS 1000000
#define PEAK_N 5.0

static volatile sig_atomic_t stop;

static void end(int number)
{
	stop = number;
}

static int64_t now(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

/* The user's force: none without a heartbeat or a valid request, then up by a ramp. */
static double take_force(const struct incise_haptic_page_user *half)
{
	static struct incise_haptic_page_user user;
	static double share, age;
	struct incise_haptic_page_user next;
	int whole = 0;

	for (int i = 0; i < 3 && !whole; i++)
		whole = incise_haptic_page_get(half, &next, sizeof(next));
	if (whole &&
	    (next.wants != INCISE_HAPTIC_PAGE_FORCE || !isfinite(*next.force_N) ||
	     next.period_ns <= 0 || next.heartbeat_ns <= 0 || next.heartbeat_ns > now() ||
	     next.period_ns > INCISE_HAPTIC_PAGE_PERIOD_NS ||
	     (int32_t)(next.seq - user.seq) < 0))
		return share = 0;
	user = whole ? next : user;
	age = (double)(now() - user.heartbeat_ns) / (double)user.period_ns;
	share += (double)PERIOD_NS / INCISE_HAPTIC_PAGE_RAMP_NS;
	share = fmin(share,
		     whole ? 1 : 2 - age); /* torn: it fades in the second period */
	if (!(age <= 2))
		share = 0;
	return fmax(-PEAK_N, fmin(PEAK_N, share * *user.force_N));
}

int main(int argc, char **argv)
{
	struct flock lock = {.l_type = F_WRLCK, .l_len = 1}; /* the owner's byte */
	struct incise_haptic_page_owner own = {.state = INCISE_HAPTIC_PAGE_READY};
	struct incise_haptic_page_sample sample = {.quaternion = {1}};
	double *x = sample.position_mm, *v = sample.velocity_mm_s;
	struct incise_haptic_page *page;
	char path[100], *name = argc > 1 ? argv[1] : "spring";
	int fd;

	snprintf(path, sizeof(path), "/dev/shm/incise-%s", name);
	fd = open(path, O_RDWR);
	if (fd >= 0 && !fcntl(fd, F_OFD_SETLK, &lock))
		unlink(path); /* that of a dead owner */
	fd = open(path, O_RDWR | O_CREAT | O_EXCL, 0600);
	if (fd < 0 || fcntl(fd, F_OFD_SETLK, &lock) || ftruncate(fd, sizeof(*page)))
		return perror(path), 1;
	page = mmap(NULL, sizeof(*page), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
	signal(SIGTERM, end);
	page->device.rate_hz = 1000;
	page->device.latency_ns = PERIOD_NS;
	page->device.peak_N = PEAK_N;
	page->device.mass_kg = 0.1, page->device.damping_N_s_mm = 0.002;
	page->device.features = INCISE_HAPTIC_PAGE_VELOCITY;
	snprintf(page->device.name, sizeof(page->device.name), "spring in C");
	snprintf(page->device.device, sizeof(page->device.device), "local:%s", name);
	for (; !stop; usleep(PERIOD_NS / 1000)) {
		*v += (take_force(&page->user) - 0.2 * *x - 0.002 * *v) / 0.1;
		*x += *v / 1000;
		sample.t_ns = own.heartbeat_ns = now();
		sample.sequence = sample.number = own.samples++;
		incise_haptic_page_put(&page->ring[sample.number % 32], &sample,
				       sizeof(sample));
		incise_haptic_page_put(&page->owner, &own, sizeof(own));
		if (!sample.number) /* from now on a user may attach */
			incise_haptic_page_publish(page, (uint32_t)getpid());
	}
	own.state = INCISE_HAPTIC_PAGE_ENDED;
	snprintf(own.reason, sizeof(own.reason), "stopped; start it again");
	incise_haptic_page_put(&page->owner, &own, sizeof(own));
	return unlink(path);
}
