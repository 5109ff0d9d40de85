// SPDX-License-Identifier: GPL-2.0-only
/*
 * incise_stepper.ko: the platform driver, and every way in which a machine stops:
 *
 *   unbind    no new file, the force of a plan fades, brake, power off, no interrupts, ENODEV
 *             to open files
 *   suspend   the force fades, brake, power off, fault SUSPEND; nothing moves after resume by
 *             itself. SYNC stops, as its chip may sleep already, and goes on in its beat
 *   reboot    the same, before anything else is taken down
 *   panic     power off, at once, without a lock
 *
 * With a crash kernel loaded (kdump) panic() starts that kernel before any notifier: no
 * step follows, but power stays on until the lines are reset. crash_kexec_post_notifiers on
 * the kernel's command line lets power go first. Binding warns of it.
 */
#include <linux/delay.h>
#include <linux/kexec.h>
#include <linux/mod_devicetable.h>
#include <linux/module.h>
#include <linux/panic_notifier.h>
#include <linux/platform_device.h>
#include <linux/pm.h>
#include <linux/property.h>
#include <linux/reboot.h>

#include "compat.h"
#include "stepper.h"

/* Longest wait for motors to brake; then they halt where they are. */
#define BRAKE_MS 2000

/* All motors without power and their timers done. Sleeps; stepper.mutex held. */
static void stepper_main_rest(struct stepper *stepper, u32 fault)
{
	unsigned int i, waited;

	if (stepper_plan_let_go(stepper, INCISE_STEPPER_PLAN_AWAY))
		stepper_plan_wait(stepper, BRAKE_MS);
	for (i = 0; i < stepper->n_motors; i++)
		stepper_setup_fault(&stepper->motor[i], fault);
	for (waited = 0; waited < BRAKE_MS && stepper_setup_any_powered(stepper);
	     waited += 2)
		usleep_range(2000, 3000);
	for (i = 0; i < stepper->n_motors; i++) {
		stepper_setup_halt(&stepper->motor[i]);
		stepper_motor_end(&stepper->motor[i]);
	}
}

static int stepper_main_reboot(struct notifier_block *block, unsigned long action,
			       void *data)
{
	struct stepper *stepper = container_of(block, struct stepper, reboot);

	mutex_lock(&stepper->mutex);
	stepper->closing = true;
	stepper_main_rest(stepper, INCISE_STEPPER_FAULT_SUSPEND);
	stepper_sync_off(stepper);
	mutex_unlock(&stepper->mutex);
	return NOTIFY_DONE;
}

/*
 * The other processors have been stopped, maybe while they held a motor's lock: so no lock
 * is taken here. Only a chip whose own lock was held then could stand in the way.
 */
static int stepper_main_panic(struct notifier_block *block, unsigned long action,
			      void *data)
{
	struct stepper *stepper = container_of(block, struct stepper, panic);
	unsigned int i;

	for (i = 0; i < stepper->n_motors; i++) {
		/* Should a timer fire once more, it finds nothing to do. */
		WRITE_ONCE(stepper->motor[i].powered, false);
		compat_gpiod_set_value(stepper->motor[i].lines.enable, 0);
	}
	return NOTIFY_DONE;
}

static int stepper_main_listen(struct stepper *stepper)
{
	int ret;

	stepper->reboot.notifier_call = stepper_main_reboot;
	stepper->panic.notifier_call = stepper_main_panic;
	ret = register_reboot_notifier(&stepper->reboot);
	if (ret)
		return ret;
	ret = atomic_notifier_chain_register(&panic_notifier_list, &stepper->panic);
	if (ret)
		unregister_reboot_notifier(&stepper->reboot);
	return ret;
}

static void stepper_main_ignore(struct stepper *stepper)
{
	atomic_notifier_chain_unregister(&panic_notifier_list, &stepper->panic);
	unregister_reboot_notifier(&stepper->reboot);
}

static int stepper_main_probe(struct platform_device *pdev)
{
	struct device *dev = &pdev->dev;
	struct stepper *stepper;
	const char *label;
	int ret;

	ret = stepper_node_count(dev);
	if (ret < 0)
		return ret;
	stepper = stepper_device_new(dev, ret);
	if (IS_ERR(stepper))
		return PTR_ERR(stepper);
	if (device_property_read_string(dev, "label", &label))
		label = dev_name(dev);
	strscpy(stepper->info.name, label, sizeof(stepper->info.name));

	ret = stepper_event_start(stepper);
	if (ret)
		goto put;
	ret = stepper_lines_get(stepper, dev);
	if (ret)
		goto put;
	ret = stepper_ability_measure(stepper);
	if (ret)
		goto put;
	ret = stepper_defaults(stepper, dev);
	if (ret)
		goto put;
	ret = stepper_lines_listen(stepper);
	if (ret)
		goto put;
	ret = stepper_main_listen(stepper);
	if (ret)
		goto ignore_lines;
	ret = stepper_device_add(stepper);
	if (ret)
		goto ignore;
	stepper_debugfs_add(stepper);
	platform_set_drvdata(pdev, stepper);
	if (kexec_crash_loaded())
		dev_warn(
			dev,
			"a panic leaves power on: crash kernel, no crash_kexec_post_notifiers\n");
	dev_info(dev,
		 "%s: %u motors, at most %u steps/s; timer latency %u ns, at most %u\n",
		 dev_name(&stepper->dev), stepper->n_motors, stepper->info.rate_max,
		 stepper->info.lateness_ns, stepper->info.lateness_max_ns);
	return 0;

ignore:
	stepper_main_ignore(stepper);
ignore_lines:
	stepper_lines_ignore(stepper);
put:
	stepper_event_end(stepper);
	stepper_latency_end(stepper);
	put_device(&stepper->dev);
	return ret;
}

static void stepper_main_remove(struct platform_device *pdev)
{
	struct stepper *stepper = platform_get_drvdata(pdev);

	stepper_debugfs_remove(stepper);
	stepper_device_remove(stepper);
	stepper_main_ignore(stepper);

	mutex_lock(&stepper->mutex);
	stepper_main_rest(stepper, INCISE_STEPPER_FAULT_GONE);
	stepper_plan_take_out(stepper);
	stepper_sync_off(stepper);
	WRITE_ONCE(stepper->gone, true);
	mutex_unlock(&stepper->mutex);

	stepper_lines_ignore(stepper);
	wake_up_all(&stepper->wait);
	stepper_event_end(stepper);
	stepper_latency_end(stepper);
	put_device(&stepper->dev);
}

COMPAT_PLATFORM_REMOVE(stepper_main_remove)

static void stepper_main_shutdown(struct platform_device *pdev)
{
	struct stepper *stepper = platform_get_drvdata(pdev);

	stepper_main_reboot(&stepper->reboot, 0, NULL);
}

static int stepper_main_suspend(struct device *dev)
{
	struct stepper *stepper = dev_get_drvdata(dev);

	mutex_lock(&stepper->mutex);
	stepper_main_rest(stepper, INCISE_STEPPER_FAULT_SUSPEND);
	stepper_sync_off(stepper);
	mutex_unlock(&stepper->mutex);
	return 0;
}

/* Motors stay off. */
static int stepper_main_resume(struct device *dev)
{
	struct stepper *stepper = dev_get_drvdata(dev);

	mutex_lock(&stepper->mutex);
	if (!stepper->closing)
		stepper_sync_resume(stepper);
	mutex_unlock(&stepper->mutex);
	return 0;
}

static DEFINE_SIMPLE_DEV_PM_OPS(stepper_main_pm, stepper_main_suspend,
				stepper_main_resume);

static const struct of_device_id stepper_main_of[] = {
	{.compatible = "incise,stepper-gpio"}, {}};
MODULE_DEVICE_TABLE(of, stepper_main_of);

static const struct platform_device_id stepper_main_ids[] = {{.name = "incise-stepper"},
							     {}};
MODULE_DEVICE_TABLE(platform, stepper_main_ids);

static struct platform_driver stepper_main_driver = {
	.probe = stepper_main_probe,
	.remove = compat_platform_remove(stepper_main_remove),
	.shutdown = stepper_main_shutdown,
	.id_table = stepper_main_ids,
	.driver.name = "incise-stepper",
	.driver.of_match_table = stepper_main_of,
	.driver.pm = pm_sleep_ptr(&stepper_main_pm),
	/* configfs waits for it; and two measurements shall not race. */
	.driver.probe_type = PROBE_FORCE_SYNCHRONOUS,
};

static int __init stepper_main_init(void)
{
	int ret;

	ret = stepper_device_init();
	if (ret)
		return ret;
	stepper_debugfs_init();
	ret = platform_driver_register(&stepper_main_driver);
	if (ret)
		goto exit_device;
	ret = stepper_configfs_init();
	if (ret)
		goto unregister;
	return 0;

unregister:
	platform_driver_unregister(&stepper_main_driver);
exit_device:
	stepper_debugfs_exit();
	stepper_device_exit();
	return ret;
}
module_init(stepper_main_init);

static void __exit stepper_main_exit(void)
{
	stepper_configfs_exit();
	platform_driver_unregister(&stepper_main_driver);
	stepper_debugfs_exit();
	stepper_device_exit();
}
module_exit(stepper_main_exit);

MODULE_DESCRIPTION("Step and direction pulses from a hard timer, for incise");
MODULE_AUTHOR("The incise authors");
MODULE_LICENSE("GPL");
