from drake_ispace.cli.start import main

main()
