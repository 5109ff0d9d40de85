// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise doctor: checks this machine and its rig for a capture and for the haptic loop, and
 * prints the command that mends each finding.
 */
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <grp.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>
#include <sys/utsname.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/realtime.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/scan.h>
#include "cli/machine.h"
#include "cli/calibration.h"
#include "cli/child.h"
#include "cli/cli.h"
#include "cli/features.h"
#include "cli/file.h"
#include "cli/json.h"
#include "cli/report_script.h"
#include "doctor/protocol.h"

#define CHECKS_MAX 120
#define MINUTES_LEAST 10 /* of recording, below which the disk is a warning */
#define GIB (1024.0 * 1024 * 1024)

enum state { OK, WARNING, PROBLEM };
static const char *const state_names[] = {"ok", "warning", "problem"};
static const enum cli_colour state_colours[] = {CLI_GREEN, CLI_YELLOW, CLI_RED};

struct check {
	const char *group, *name;
	enum state state;
	char *found, *fix;
};

struct doctor {
	const char *rig, *calibration;
	bool json;
	struct check check[CHECKS_MAX];
	int n;

	/* The rig's steppers, and the devices that opened. */
	char steppers[1000]; /* "kernel:… can:can0:0x10 …" */
	struct incise_tracker_info tracker;
	struct incise_force_info force;
	struct incise_camera_info camera;
	bool has_rig, has_tracker, has_force, has_camera;
	double recording_min; /* that the disk holds; NAN: not known */

	const char *report;
	bool asked;	      /* for the protocol */
	bool has_haptic;      /* the rig names a haptic device */
	bool haptic_measured; /* then: */
	struct protocol protocol;
	struct incise_error err; /* of its walls */
};

static const struct cli_option option_table[] = {
	{CLI_RIG_OPTION(struct doctor, rig)},
	{'c', "calibration", "FILE",
	 "calibration to check (default: ./calibration.conf, else "
	 "/etc/incise/calibration.conf)",
	 CLI_INPUT(struct doctor, calibration)},
	{0, "protocol", NULL,
	 "run the protocol of doc/devices.md with the haptic device: noise and latency for 10 s "
	 "while its handle rests, then, with force, four walls and a weight",
	 CLI_FLAG(struct doctor, asked)},
	{0, "report", "FILE.json",
	 "write one file to send: the checks, this machine, rig.conf and the haptic device",
	 CLI_OUTPUT(struct doctor, report), .extensions = ".json"},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct doctor, json)},
	{0},
};

static const struct cli_command command = {
	.name = "doctor",
	.synopsis = "[--rig RIG] [-c FILE] [--report FILE.json] [--json]",
	.summary =
		"Check this machine and its rig, and print the command that mends each "
		"finding.",
	.options = option_table,
	.notes =
		"Actuators are only watched, and without --protocol a haptic device gives no "
		"force: nothing moves.",
	.success = "no problem",
	.failure = "at least one problem",
};

/* @fix: NULL if nothing is to be done. */
static void INCISE_PRINTF(6, 7)
	add(struct doctor *doctor, const char *group, const char *name, enum state state,
	    const char *fix, const char *fmt, ...)
{
	struct check *check = &doctor->check[doctor->n];
	va_list args;

	if (doctor->n == CHECKS_MAX)
		return;
	*check = (struct check){group, name, state};
	va_start(args, fmt);
	if (vasprintf(&check->found, fmt, args) < 0)
		cli_fail("no memory");
	va_end(args);
	check->fix = cli_text("%s", fix ? fix : "");
	doctor->n++;
}

/* Whether this process has the group's rights now, which begin with a login. */
static bool has_group(gid_t wanted)
{
	gid_t groups[256];
	int n = getgroups(256, groups);

	for (int i = 0; i < n; i++)
		if (groups[i] == wanted)
			return true;
	return getegid() == wanted;
}

static void check_group(struct doctor *doctor)
{
	const struct group *group = getgrnam("incise");

	if (!geteuid())
		add(doctor, "permissions", "group", OK, NULL,
		    "root may open every device");
	else if (!group)
		add(doctor, "permissions", "group", WARNING,
		    "sudo systemd-sysusers    # after installing incise",
		    "the group incise does not exist: only root may open the devices");
	else if (!has_group(group->gr_gid))
		add(doctor, "permissions", "group", WARNING,
		    "sudo usermod -aG incise $USER    # takes effect at the next login",
		    "this user is not a member of group incise");
	else
		add(doctor, "permissions", "group", OK, NULL, "member of group incise");
}

static void check_realtime(struct doctor *doctor)
{
	const struct incise_realtime_setup setup = {
		.policy = INCISE_REALTIME_FIFO,
		.priority = INCISE_REALTIME_PRIORITY,
		.cpu = INCISE_REALTIME_ANY_CPU,
		.period_ns = 1000000,
	};
	static struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	int n = incise_realtime_checks(&setup, checks, INCISE_REALTIME_CHECKS);

	if (n < 0)
		add(doctor, "real time", "checks", PROBLEM, NULL, "not possible: %s",
		    strerror(-n));
	for (int i = 0; i < n && i < INCISE_REALTIME_CHECKS; i++)
		add(doctor, "real time", checks[i].name,
		    checks[i].ok       ? OK
		    : checks[i].needed ? PROBLEM
				       : WARNING,
		    *checks[i].keep ? checks[i].keep : checks[i].fix, "%s",
		    checks[i].found);
}

static void check_module(struct doctor *doctor)
{
	struct utsname kernel;

	if (!access("/sys/module/incise_stepper", F_OK)) {
		add(doctor, "kernel", "module", OK, NULL, "incise_stepper is loaded");
		return;
	}
	uname(&kernel);
	if (doctor->has_rig && !strstr(doctor->steppers, "kernel:"))
		add(doctor, "kernel", "module", OK, NULL,
		    "incise_stepper is not loaded; the rig has no stepper \"kernel:…\"");
	else
		add(doctor, "kernel", "module", WARNING,
		    "sudo modprobe incise_stepper    # of the package incise-dkms, or make module_install",
		    "incise_stepper is not loaded (Linux %s); a rig needs it for a "
		    "stepper \"kernel:…\"",
		    kernel.release);
}

static void add_module(void *context, const struct feature *feature)
{
	const char *fix = strstr(feature->detail, "sudo ");
	char *name = cli_text("%s_%s", feature->kind, feature->name);

	if (!feature->usable)
		add(context, "modules", "module", WARNING, fix,
		    "%s cannot be loaded: %.*s", name,
		    fix ? (int)strcspn(feature->detail, ";") : -1, feature->detail);
	free(name);
}

static void count_module(void *context, const struct feature *feature)
{
	*(int *)context += feature->usable;
}

/* The modules for devices and file formats. */
static void check_modules(struct doctor *doctor)
{
	int n = 0;

	features_each(count_module, &n);
	add(doctor, "modules", "loadable", n ? OK : WARNING,
	    "make && sudo make install    # or the package libincise2",
	    "%d modules of devices and file formats%s", n,
	    *features_left_out ? "" : "; the build left none out");
	features_each(add_module, doctor);
	if (*features_left_out)
		add(doctor, "modules", "left out", OK, NULL,
		    "this incise was built without %s", features_left_out);
}

/* Programs that other commands call. */
static void check_programs(struct doctor *doctor)
{
	char *const jinja2[] = {REPORT_PYTHON, "-B", "-c", "import jinja2", NULL};
	const struct {
		const char *name, *what;
		bool there;
	} programs[] = {
		{"gnuplot", "plots", child_possible("gnuplot")},
		{"jinja2", "HTML reports", !child_run(jinja2, -1, -1, -1)},
	};

	for (size_t i = 0; i < sizeof(programs) / sizeof(*programs); i++) {
		char *fix = cli_text("sudo %s", features_remedy(programs[i].name));

		add(doctor, "programs", programs[i].name,
		    programs[i].there ? OK : WARNING, fix, "%s%s",
		    programs[i].there ? "draws " : "is missing: no ", programs[i].what);
		free(fix);
	}
}

#define GLANCE_S 1.0
#define REST_S 10.0
#define OLD_MS 1000	 /* beyond, times are of another clock */
#define RATE_SHARE 0.5	 /* of the declared rate, that it may differ by */
#define LENGTH2_OFF 0.02 /* of a quaternion, as the loop takes it */

static void add_state(struct doctor *doctor, const struct handle *handle)
{
	struct incise_error err = {0};
	bool fault = handle_check(handle, &err);

	add(doctor, "devices", "state", fault ? WARNING : OK, "incise help rig.conf",
	    "%s; buttons: %d, pressed: %#x",
	    fault					 ? err.text
	    : handle->last.flags & INCISE_HAPTIC_BATTERY ? "ready, but a battery is low"
							 : "ready",
	    handle->info.buttons, handle->last.buttons);
}

/* For each of these the loop gives no force. */
static void add_refusals(struct doctor *doctor, const struct handle *handle)
{
	const struct incise_haptic_info *info = &handle->info;
	const double *q = handle->last.quaternion,
		     age_ms = doctor->protocol.age_median_ms;
	double length2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];

	if (!(fabs(age_ms) <= OLD_MS))
		add(doctor, "devices", "times", PROBLEM, "incise help rig.conf",
		    "samples are %.3g s old: its times are not of CLOCK_MONOTONIC",
		    age_ms * 1e-3);
	if (!(info->peak_N > 0))
		add(doctor, "devices", "peak_N", PROBLEM, "incise help rig.conf",
		    "0 N: incise haptic refuses it: set haptic_setup.peak_N");
	if (!(info->mass_kg > 0))
		add(doctor, "devices", "mass_kg", PROBLEM, "incise help rig.conf",
		    "0 kg: incise haptic refuses it: set haptic_setup.mass_kg");
	if (!(fabs(length2 - 1) < LENGTH2_OFF))
		add(doctor, "devices", "quaternion", PROBLEM, NULL,
		    "(%.3g, %.3g, %.3g, %.3g) is no rotation: incise haptic takes no pose "
		    "of it; 1 0 0 0 is that of a device without orientation",
		    q[0], q[1], q[2], q[3]);
	if (info->rate_hz > 0 &&
	    !(fabs(doctor->protocol.rate_hz / info->rate_hz - 1) <= RATE_SHARE))
		add(doctor, "devices", "rate", WARNING, "incise help rig.conf",
		    "%.0f Hz, but it declares %.0f Hz: set haptic_setup.rate_hz",
		    doctor->protocol.rate_hz, info->rate_hz);
}

static void add_haptic(struct doctor *doctor, struct incise_rig *rig)
{
	struct protocol *protocol = &doctor->protocol;
	struct incise_error err = {0};
	struct handle handle;
	const char *failed;
	int rc = 0;

	handle_begin(&handle, rig);
	if (doctor->asked && !protocol->simulated && isatty(STDIN_FILENO)) {
		fprintf(stderr, "lay the handle down so that nothing moves it, and press "
				"Enter or a button\n");
		rc = handle_await_press(&handle, &err);
	}
	if (!rc)
		rc = handle_record(&handle, doctor->asked ? REST_S : GLANCE_S, &err);
	if (rc) {
		add(doctor, "devices", "samples", PROBLEM, "incise help rig.conf", "%s",
		    err.text);
		return;
	}
	protocol_measure(protocol, &handle, doctor->asked);
	if (doctor->asked)
		protocol->limit_N_mm =
			protocol_limit(rig, handle.info.peak_N, &doctor->err);
	doctor->haptic_measured = true;
	failed = protocol_failed(protocol, SD);
	add(doctor, "devices", "samples", failed ? WARNING : OK, "incise help doctor",
	    "%s: %.0f Hz, %.2f ms old (99 %%: %.2f, at most %.2f), %.2g %% lost%s%s",
	    handle.info.name, protocol->rate_hz, protocol->age_median_ms,
	    protocol->value[AGE], protocol->value[AGE_MOST], protocol->value[LOST],
	    failed ? "; above its mark: " : "", failed ? failed : "");
	add_state(doctor, &handle);
	add_refusals(doctor, &handle);
	if (*handle.info.filters)
		add(doctor, "devices", "filters", OK, NULL, "%s", handle.info.filters);
	if (*handle.info.note)
		add(doctor, "devices", "note", OK, NULL, "%s", handle.info.note);
	free(handle.samples);
}

static void add_opened(struct doctor *doctor, const char *name, struct incise_rig *rig)
{
	if (incise_rig_tracker(rig)) {
		incise_tracker_info(incise_rig_tracker(rig), &doctor->tracker);
		if (doctor->tracker.network)
			add(doctor, "devices", "network", WARNING,
			    "man rig.conf    # the section on OpenIGTLink",
			    "the haptic loop fades the force whenever the network delays "
			    "poses of %s",
			    doctor->tracker.name);
	}
	if (incise_rig_force(rig))
		incise_force_info(incise_rig_force(rig), &doctor->force);
	if (incise_rig_camera(rig))
		incise_camera_info(incise_rig_camera(rig), &doctor->camera);
	doctor->has_tracker |= !!incise_rig_tracker(rig);
	doctor->has_force |= !!incise_rig_force(rig);
	doctor->has_camera |= !!incise_rig_camera(rig);
	add(doctor, "devices", name, OK, NULL, "opens");
	if (incise_rig_haptic(rig))
		add_haptic(doctor, rig);
}

/* After the rig is closed: a device has one user. */
static void check_force(struct doctor *doctor)
{
	struct protocol *protocol = &doctor->protocol;
	const double *swings = protocol->value + SWINGS;

	if (!doctor->haptic_measured || !doctor->asked)
		return;
	if (!protocol->simulated && !isatty(STDIN_FILENO))
		add(doctor, "devices", "walls", WARNING,
		    "incise doctor --protocol    # on a terminal",
		    "not measured: standard input is no terminal, and a hand must lean on "
		    "them");
	else if (!(protocol->limit_N_mm > 0) || protocol_force(protocol, &doctor->err))
		add(doctor, "devices", "walls", PROBLEM, "incise help doctor",
		    "not measured: %s", doctor->err.text);
	else
		add(doctor, "devices", "walls",
		    protocol_failed(protocol, WEIGHT) ? WARNING : OK,
		    "incise help doctor",
		    "%.2g, %.2g, %.2g, %.2g swings a second at 25, 50, 75, 90 %% of %.3g "
		    "N/mm; 100 g: %.1f %% off",
		    swings[0], swings[1], swings[2], swings[3], protocol->limit_N_mm,
		    protocol->value[WEIGHT]);
}

/* Try one kind of device. A rig need not name each. */
static void check_device(struct doctor *doctor, const char *rig, const char *name,
			 unsigned int devices)
{
	struct incise_error err = {0};
	struct incise_rig *open = incise_rig_open(rig, devices, &err);

	bool none =
		open ? (devices & INCISE_RIG_CAMERA && !incise_rig_camera(open)) ||
				(devices & INCISE_RIG_HAPTIC && !incise_rig_haptic(open))
		     : err.code == ENODEV &&
				(strstr(err.text, "missing, but required") ||
				 strstr(err.text, "a haptic device alone has no"));

	doctor->has_haptic |= devices & INCISE_RIG_HAPTIC && !none;
	if (none && devices & INCISE_RIG_HAPTIC)
		; /* as of most rigs */
	else if (none)
		add(doctor, "devices", name, OK, NULL, "the rig names none");
	else if (open)
		add_opened(doctor, name, open);
	else if (err.code == EBUSY || err.code == EAGAIN)
		add(doctor, "devices", name, WARNING, "incise status", "%s", err.text);
	else
		add(doctor, "devices", name, PROBLEM,
		    err.code == EACCES
			    ? "sudo usermod -aG incise $USER    # takes effect at "
			      "the next login"
		    : strstr(err.text, "/etc/incise/stepper.conf")
			    ? "sudo cp /usr/share/incise/stepper.conf.example "
			      "/etc/incise/stepper.conf    # edit it, then sudo systemctl "
			      "enable --now incise-stepper"
			    : "incise info devices    # lists what is attached",
		    "%s", err.text);
	incise_rig_close(open);
}

/* Keep the steppers, and whether the haptic device is a simulated one. */
static int keep_devices(void *context, const struct incise_key *key)
{
	struct doctor *doctor = context;
	size_t used = strlen(doctor->steppers);

	if (!strncmp(key->name, "stepper", 7))
		snprintf(doctor->steppers + used, sizeof(doctor->steppers) - used, " %s",
			 key->value);
	if (!strcmp(key->name, "haptic"))
		doctor->protocol.simulated = !strncmp(key->value, "\"sim:", 5);
	return 0;
}

/* The devices of the rig, if there is one without an error. */
static void read_rig(struct doctor *doctor)
{
	struct protocol *protocol = &doctor->protocol;

	if (!doctor->rig)
		doctor->rig = cli_default_rig();
	doctor->has_rig =
		doctor->rig && !incise_rig_keys(doctor->rig, keep_devices, doctor, NULL);
	protocol->has_hand = doctor->asked && doctor->rig &&
			     !strncmp(doctor->rig, "sim:haptic", strlen("sim:haptic"));
	protocol->simulated |= protocol->has_hand;
	if (protocol->has_hand)
		doctor->rig = cli_text("%s,motion=still", doctor->rig);
	protocol->rig = doctor->rig;
	protocol->calibration = doctor->calibration	? doctor->calibration
				: calibration_default() ? calibration_default()
							: "none";
}

static void check_rig(struct doctor *doctor)
{
	static const struct {
		const char *name;
		unsigned int devices;
	} kinds[] = {
		{"haptic", INCISE_RIG_HAPTIC},
		{"tracker", INCISE_RIG_TRACKER},
		{"force", INCISE_RIG_FORCE},
		{"camera", INCISE_RIG_CAMERA | INCISE_RIG_IF_NAMED},
		{"stepper", INCISE_RIG_STEPPER | INCISE_RIG_WATCH},
	};
	const char *rig = doctor->rig;
	struct incise_error err = {0};
	struct incise_rig *open;

	if (!rig) {
		add(doctor, "devices", "rig", WARNING,
		    "incise init    # asks for its devices, and writes it",
		    "there is neither ./rig.conf nor /etc/incise/rig.conf");
		return;
	}
	open = incise_rig_open(rig, 0, &err);
	if (!open) {
		add(doctor, "devices", "rig", PROBLEM, "incise help rig.conf", "%s",
		    err.text);
		return;
	}
	add(doctor, "devices", "rig", OK, NULL, "%s", rig);
	incise_rig_close(open);
	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
		/* A haptic device is tracker and stepper, too. */
		if (!doctor->has_haptic ||
		    !(kinds[i].devices & (INCISE_RIG_TRACKER | INCISE_RIG_STEPPER)))
			check_device(doctor, rig, kinds[i].name, kinds[i].devices);
	check_force(doctor);
}

/* --- what is attached, whether the rig names it or not --- */

static int add_attached(void *context, const struct incise_scan_device *device)
{
	bool denied = strstr(device->what, strerror(EACCES));
	bool haptic = device->usable && !strcmp(device->kind, "haptic");

	add(context, "attached", cli_text("%s", device->kind),
	    device->usable ? OK : WARNING,
	    denied ? "sudo usermod -aG incise $USER    # takes effect at the next login"
		   : "incise info devices",
	    haptic ? "haptic = \"%s\";    # %s" : "%s: %s", device->device, device->what);
	return 0;
}

/* The first line of a file of sysfs without its newline; "" if there is none. */
static void sysfs_text(char *text, size_t size, const char *folder, const char *device,
		       const char *name)
{
	char *path = cli_text("%s/%s/%s", folder, device, name);

	*text = '\0';
	machine_line(path, "", text, (int)size);
	free(path);
}

#define SYSFS_NET "/sys/class/net"
#define ARPHRD_CAN "280"

/* A CAN interface; others are not listed. */
static void add_can(struct doctor *doctor, const char *name)
{
	char type[16], flags[16], *named = cli_text("can:%s:", name), *fix;
	bool up, used = strstr(doctor->steppers, named);

	free(named);
	sysfs_text(type, sizeof(type), SYSFS_NET, name, "type");
	if (strcmp(type, ARPHRD_CAN))
		return;
	sysfs_text(flags, sizeof(flags), SYSFS_NET, name, "flags");
	up = strtoul(flags, NULL, 16) & 1; /* IFF_UP */
	fix = cli_text("sudo ip link set %s up type can bitrate 1000000", name);
	add(doctor, "attached", "can", up || (doctor->has_rig && !used) ? OK : WARNING,
	    fix, "%s: CAN interface, %s%s", name, up ? "up" : "down",
	    used	      ? "; the rig has a drive on it"
	    : doctor->has_rig ? "; the rig does not use it"
			      : "");
	free(fix);
}

#define SYSFS_USB "/sys/bus/usb/devices"
#define USB_HUB "09"

/* A USB device by its name; hubs and interfaces ("1-1:1.0") are not listed. */
static void add_usb(struct doctor *doctor, const char *name)
{
	char class[8], vendor[8], product[8], maker[80], text[80];

	sysfs_text(class, sizeof(class), SYSFS_USB, name, "bDeviceClass");
	if (strchr(name, ':') || !*class || !strcmp(class, USB_HUB))
		return;
	sysfs_text(vendor, sizeof(vendor), SYSFS_USB, name, "idVendor");
	sysfs_text(product, sizeof(product), SYSFS_USB, name, "idProduct");
	sysfs_text(maker, sizeof(maker), SYSFS_USB, name, "manufacturer");
	sysfs_text(text, sizeof(text), SYSFS_USB, name, "product");
	add(doctor, "attached", "usb", OK, NULL, "%s:%s at %s: %s%s%s", vendor, product,
	    name, maker, *maker && *text ? " " : "", *text || *maker ? text : "no name");
}

static int is_visible(const struct dirent *entry)
{
	return entry->d_name[0] != '.';
}

static void each_entry(struct doctor *doctor, const char *folder,
		       void (*add_entry)(struct doctor *doctor, const char *name))
{
	struct dirent **entries = NULL;
	int n = scandir(folder, &entries, is_visible, alphasort);

	for (int i = 0; i < n; i++) {
		add_entry(doctor, entries[i]->d_name);
		free(entries[i]);
	}
	free(entries);
}

static void check_attached(struct doctor *doctor)
{
	int before = doctor->n;

	incise_scan(NULL, NULL, add_attached, doctor, NULL);
	each_entry(doctor, SYSFS_NET, add_can);
	each_entry(doctor, SYSFS_USB, add_usb);
	if (doctor->n == before)
		add(doctor, "attached", "devices", OK, NULL,
		    "no tracker, converter, camera, CAN interface or USB device");
}

static void check_display(struct doctor *doctor)
{
	const char *wayland = getenv("WAYLAND_DISPLAY"), *x11 = getenv("DISPLAY");

	if ((wayland && *wayland) || (x11 && *x11))
		add(doctor, "display", "window", OK, NULL, "%s",
		    wayland && *wayland ? wayland : x11);
	else
		add(doctor, "display", "window", WARNING,
		    "incise view SCENE --procedure -o FILE.mp4    # needs no display",
		    "neither DISPLAY nor WAYLAND_DISPLAY is set: incise view has no window");
}

/* The report of incise calibrate check, or NULL. */
static json_t *calibration_report(const char *path)
{
	char *program = cli_text("%s/incise-calibrate-check", cli_folder());
	char *argv[] = {program, "-c", (char *)path, "--json", NULL};
	struct incise_error err = {0};
	json_t *report = NULL;
	int ends[2];
	FILE *file;
	pid_t pid;

	if (pipe(ends))
		cli_fail("%s", strerror(errno));
	pid = child_start(argv, ends[1], -1);
	close(ends[1]);
	file = fdopen(ends[0], "r");
	if (file) {
		report = json_read_from(file, "calibrate check", &err);
		fclose(file);
	}
	child_end(pid, 5);
	free(program);
	return report;
}

static void check_calibration(struct doctor *doctor)
{
	const char *path = doctor->calibration	   ? doctor->calibration
			   : calibration_default() ? calibration_default()
						   : "calibration.conf";
	/* incise init goes on with the files of this folder. */
	bool leads = doctor->rig && !strcmp(doctor->rig, "rig.conf") &&
		     !strcmp(path, "calibration.conf");
	unsigned int devices =
		doctor->has_rig ? calibration_devices(doctor->rig, NULL) : 0;
	json_t *report, *kind;
	size_t i;

	if (access(path, F_OK)) {
		add(doctor, "calibration", "file",
		    doctor->calibration ? PROBLEM : WARNING,
		    leads ? "incise init" : "incise help calibrate",
		    "%s: %s; nominal values apply", path, strerror(errno));
		return;
	}
	report = calibration_report(path);
	if (!report) {
		add(doctor, "calibration", "file", PROBLEM,
		    "incise calibrate check    # prints the reason", "%s cannot be read",
		    path);
		return;
	}
	json_array_foreach(json_object_get(report, "kinds"), i, kind)
	{
		const char *name = json_string_value(json_object_get(kind, "kind"));
		const char *why = json_string_value(json_object_get(kind, "why"));
		double days = json_number_value(json_object_get(kind, "age_days"));
		bool due = json_is_true(json_object_get(kind, "due"));
		bool old = json_is_string(json_object_get(kind, "date"));
		char *fix = leads && !old
				    ? cli_text("incise init")
				    : cli_text("incise calibrate %s", name ? name : "");

		/* The report, with the names, is released below. */
		name = cli_text("%s", name ? name : "");
		if (devices && !calibration_needed(name, devices))
			;
		else if (due)
			add(doctor, "calibration", name, WARNING, fix, "%s",
			    why ? why : "due");
		else
			add(doctor, "calibration", name, OK, NULL, "%.0f days old",
			    floor(days));
		free(fix);
	}
	json_decref(report);
}

static void check_disk(struct doctor *doctor)
{
	struct statvfs disk;
	char *space = NULL;
	double free_GiB;
	bool little;

	if (statvfs(".", &disk)) {
		add(doctor, "disk", "free", WARNING, NULL, "%s", strerror(errno));
		return;
	}
	free_GiB = (double)disk.f_bavail * (double)disk.f_frsize / GIB;
	if (doctor->has_tracker || doctor->has_force || doctor->has_camera) {
		doctor->recording_min =
			incise_recorder_capacity_s(
				free_GiB * GIB,
				doctor->has_tracker ? &doctor->tracker : NULL,
				doctor->has_force ? &doctor->force : NULL,
				doctor->has_camera ? &doctor->camera : NULL) /
			60;
		space = cli_text(": %.0f min of recording at the rates of this rig",
				 floor(doctor->recording_min));
	}
	little = free_GiB < 1 || doctor->recording_min < MINUTES_LEAST;
	add(doctor, "disk", "free", little ? WARNING : OK,
	    "df -h .    # record to a disk with more space", "%.1f GiB here%s", free_GiB,
	    space ? space : "");
	free(space);
	if (access(".", W_OK))
		add(doctor, "disk", "folder", WARNING, "cd    # to a folder of yours",
		    "the current folder may not be written to");
}

static int count_doctor(const struct doctor *doctor, enum state state)
{
	int n = 0;

	for (int i = 0; i < doctor->n; i++)
		n += doctor->check[i].state == state;
	return n;
}

/* The one command to type now. */
static const char *choose_next(const struct doctor *doctor)
{
	static const struct {
		const char *group, *name; /* NULL: any */
		enum state state;
	} order[] = {
		{"devices", "rig", WARNING}, /* there is none */
		{NULL, NULL, PROBLEM},
		{"calibration", NULL, WARNING},
	};
	size_t n = sizeof(order) / sizeof(*order);

	/* Nominal values are right for "sim:…". */
	if (doctor->rig && !strncmp(doctor->rig, "sim:", strlen("sim:")))
		n--;
	for (size_t i = 0; i < n; i++)
		for (int j = 0; j < doctor->n; j++) {
			const struct check *check = &doctor->check[j];

			if (check->state == order[i].state && *check->fix &&
			    (!order[i].group || !strcmp(order[i].group, check->group)) &&
			    (!order[i].name || !strcmp(order[i].name, check->name)))
				return check->fix;
		}
	return doctor->has_tracker && doctor->has_force ? "incise capture -o first.rec"
							: "incise haptic liver";
}

static void print(const struct doctor *doctor)
{
	const char *group = "";

	for (int i = 0; i < doctor->n; i++) {
		const struct check *check = &doctor->check[i];

		if (strcmp(group, check->group))
			printf("%s%s\n", i ? "\n" : "", check->group);
		group = check->group;
		printf("  %s%-8s%s %-11s %s\n",
		       cli_colour(stdout, state_colours[check->state]),
		       state_names[check->state], cli_colour(stdout, CLI_PLAIN),
		       check->name, check->found);
		if (check->state != OK && *check->fix)
			printf("  %21s→ %s\n", "", check->fix);
	}
	printf("\n%s, %s\n", cli_count(count_doctor(doctor, PROBLEM), "problem"),
	       cli_count(count_doctor(doctor, WARNING), "warning"));
	cli_written();
	printf("next: %s\n", choose_next(doctor));
}

static json_t *make_doctor_json(const struct doctor *doctor)
{
	json_t *checks = json_array();

	for (int i = 0; i < doctor->n; i++) {
		const struct check *check = &doctor->check[i];

		json_array_append_new(checks,
				      json_pack("{s:s, s:s, s:s, s:o, s:o}", "group",
						check->group, "name", check->name,
						"state", state_names[check->state],
						"found", json_text(check->found), "fix",
						check->state == OK || !*check->fix
							? json_null()
							: json_text(check->fix)));
	}
	return json_pack(
		"{s:o, s:i, s:i, s:o, s:o, s:o}", "checks", checks, "problems",
		count_doctor(doctor, PROBLEM), "warnings", count_doctor(doctor, WARNING),
		"next", json_text(choose_next(doctor)), "recording_min",
		json_number(doctor->recording_min), "haptic",
		doctor->haptic_measured ? protocol_json(&doctor->protocol) : json_null());
}

/* Whether two characters are of one word. */
static bool joins_word(char a, char b)
{
	return (isalnum((unsigned char)a) || a == '_') &&
	       (isalnum((unsigned char)b) || b == '_');
}

/* Replace each @secret that is a whole word, or begins and ends as one. */
static char *hide_word(const char *text, const char *secret)
{
	size_t length = secret ? strlen(secret) : 0, size;
	char *hidden = NULL, last = '\0';
	FILE *out = open_memstream(&hidden, &size);

	if (!out)
		cli_fail("no memory");
	while (*text) {
		bool found = length > 2 && !strncmp(text, secret, length) &&
			     !joins_word(last, *text) &&
			     !joins_word(text[length - 1], text[length]);
		size_t step = found ? length : 1;

		fprintf(out, "%.*s", found ? 3 : 1, found ? "***" : text);
		last = text[step - 1];
		text += step;
	}
	if (fclose(out))
		cli_fail("no memory");
	return hidden;
}

/* Leave the names of this host and of its user's folder out of a text; keys and fixed words stay. */
static void hide_names(json_t *text)
{
	struct utsname host = {0};
	char *hidden[3] = {NULL};

	if (!json_is_string(text))
		return;
	uname(&host);
	hidden[0] = hide_word(json_string_value(text), getenv("HOME"));
	hidden[1] = hide_word(hidden[0], host.nodename);
	host.nodename[strcspn(host.nodename, ".")] = '\0';
	hidden[2] = hide_word(hidden[1], host.nodename);
	json_string_set(text, hidden[2]);
	for (int i = 0; i < 3; i++)
		free(hidden[i]);
}

static void hide_report(json_t *report)
{
	static const char *const of_device[] = {"name", "filters", "note"};
	const json_t *device = json_object_get(report, "haptic");
	json_t *value;
	const char *key;
	size_t i;

	json_array_foreach(json_object_get(report, "checks"), i, value)
		hide_names(json_object_get(value, "found"));
	json_object_foreach(json_object_get(report, "machine"), key, value)
		hide_names(value);
	for (i = 0; i < sizeof(of_device) / sizeof(*of_device); i++)
		hide_names(json_object_get(device, of_device[i]));
	hide_names(json_object_get(report, "rig"));
}

static void write_report(const struct doctor *doctor)
{
	static const struct incise_infile_kind conf = {.name = "a rig.conf",
						       .size_max = 1 << 20};
	const char *spec = doctor->rig ? doctor->rig : "";
	json_t *report = json_with_schema(make_doctor_json(doctor), NULL);
	struct incise_outfile *file;
	FILE *out = whole_file_begin(doctor->report, &file);
	size_t size;
	char *rig = incise_infile_read(spec, &conf, &size, NULL);

	json_object_set_new(report, "machine", machine_json());
	json_object_set_new(report, "rig", json_text_or_null(rig ? rig : spec));
	hide_report(report);
	json_dumpf(report, out, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
	whole_file_end(file);
	json_decref(report);
	free(rig);
}

int main(int argc, char **argv)
{
	static struct doctor doctor = {.recording_min = NAN};

	cli_parse(&command, argc, argv, &doctor);
	cli_no_operands(argc, argv, "--rig");
	read_rig(&doctor);
	check_group(&doctor);
	check_realtime(&doctor);
	check_module(&doctor);
	check_modules(&doctor);
	check_programs(&doctor);
	check_rig(&doctor);
	check_attached(&doctor);
	check_display(&doctor);
	check_calibration(&doctor);
	check_disk(&doctor);
	if (doctor.asked && !doctor.has_haptic)
		cli_fail("--protocol: the rig has no haptic device; name one by --rig");
	if (doctor.report)
		write_report(&doctor);
	if (doctor.json)
		json_print(make_doctor_json(&doctor));
	else
		print(&doctor);
	cli_finish();
	return count_doctor(&doctor, PROBLEM) ? 1 : 0;
}
