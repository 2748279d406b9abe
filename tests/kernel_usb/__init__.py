"""``make test-kernel-usb``: the USB and serial drivers on a real Linux USB stack, without a rig.

    host    run.py       packages.py fetches Debian's qemu and kernel, image.py makes an initramfs
            └─ qemu      software emulation: no KVM, no privileges
    guest   guest.py     loads the kernel's USB modules, runs the cases, one line of JSON for each
            ├─ usbip.py  the emulated rig on vhci-hcd, for pyusb and libusb
            └─ gadget.py the emulated rig on dummy_hcd as a CDC-ACM port: a true /dev/ttyACM0

Opt-in: it downloads packages and takes minutes. `make test` does not run it.
"""
